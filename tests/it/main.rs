mod brdf;
mod descriptor;
