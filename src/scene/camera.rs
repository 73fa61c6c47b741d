//! Cameras: film position and lens sample to ray.

use super::description::{CameraDesc, FilmDesc};
use crate::math::{Vec2, Vec3};

/// A ray from the camera. `d` is a unit vector; the camera sees depths between the clip planes only.
#[derive(Clone, Copy, Debug)]
pub struct CameraRay {
    /// Origin on the lens (not on the near plane).
    pub o: Vec3,
    /// Direction, unit.
    pub d: Vec3,
    /// Distance at which the ray starts.
    pub tmin: f32,
    /// Distance at which the ray ends.
    pub tmax: f32,
}

/// A camera, ready to generate rays.
#[derive(Clone, Debug)]
pub struct Camera {
    _todo: (),
}

impl Camera {
    /// Builds the camera. The error is a text without location (the reader adds it).
    pub fn new(desc: &CameraDesc, film: &FilmDesc) -> Result<Self, String> {
        let _ = (desc, film);
        todo!("helper lights")
    }

    /// The ray through film position `film` (pixels of the full image, (0,0) top left) from lens sample `u_lens`.
    pub fn ray(&self, film: Vec2, u_lens: Vec2) -> CameraRay {
        let _ = (film, u_lens);
        todo!()
    }
}
