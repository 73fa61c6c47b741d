//! Images: the film that integrators write to, picture files, and metrics that compare pictures.

pub mod film;
