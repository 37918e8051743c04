//! How different do two materials look? A trainer for perceptual BRDF metrics.
//!
//! The rooms, top to bottom; a room uses only rooms above it:
//!
//! | room | holds |
//! | --- | --- |
//! | [`math`] | directions, coordinates, colour, statistics of numbers, dense layers, dual numbers, seeds |
//! | [`brdf`] | the trait [`brdf::Brdf`], tables, published models, file formats, the source notation |
//! | [`dataset`] | studies: rated pairs, manifests, grouped splits, the embedded synthetic study |
//! | [`descriptor`] | a BRDF becomes comparable numbers: virtual pictures, angular ratios, embeddings; the cache |
//! | [`metric`] | the trait [`metric::Metric`]; Lp, learned metrics; the registry |
//! | [`fit`] | parameters of a model from a measured BRDF, with any metric as the loss |
//! | [`train`] | ratings become a metric: baselines, kernels, networks (the only place that names burn), export |
//! | [`evaluation`] | agreement with people: cross-validation, bootstrap, tests of differences, records |
//! | [`render`] | small pictures of materials for people to look at |
//! | [`study`] | statistics of the ratings themselves: what a panel said, how far it agrees, what moves it |
//! | [`report`] | records become tables, figures and pages |
//! | [`cli`] | the commands |

pub mod brdf;
pub mod cli;
pub mod dataset;
pub mod descriptor;
pub mod evaluation;
pub mod fit;
pub mod math;
pub mod metric;
pub mod render;
pub mod report;
pub mod study;
pub mod train;
