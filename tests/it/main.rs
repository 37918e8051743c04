mod brdf;
mod dataset;
