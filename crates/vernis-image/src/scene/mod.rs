//! What is rendered: shape, table, lights and camera.
