//! What a BRDF looks like: the stimuli of the study of Lavoué, Bonneel, Farrugia and Soler (2021, doi:10.1111/cgf.142636), path
//! traced, and the metrics that compare pictures.
//!
//! Rooms, each of which uses only those before it: [`picture`], the array of pixels and its files; [`scene`], what is rendered;
//! [`trace`], how; [`display`], how a screen shows it; [`metric`], how different two pictures are.

pub mod display;
pub mod metric;
pub mod picture;
pub mod scene;
pub mod trace;
