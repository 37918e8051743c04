mod brdf;
