//! Cameras: film position and lens sample to ray.
//!
//! Film positions are pixels of the full image, (0,0) at its top left corner; camera space has +z into the scene,
//! +y up and +x to the *left* of the picture. Conventions, the principal point's sign and the lens are those of
//! Mitsuba 3 (`perspective`, `thinlens`, `orthographic`), checked against rays of its version 3.9.1. A mirrored
//! `to_world` is kept: converted scenes rely on it.
//! Bias: none. Not handled: lens distortion, bokeh shapes, importance of the sensor (measurement in W).

use super::description::{CameraDesc, FilmDesc, Projection};
use crate::math::warp::sample_disk;
use crate::math::{DMat4, DVec3, Vec2, Vec3};
use std::f64::consts::PI;

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
    /// Film position that it belongs to, pixels of the full image.
    pub film: Vec2,
}

/// All rays through a rectangle of the film and all of the lens, affine in film and lens position:
/// o = `o` + f0 `o_film[0]` + f1 `o_film[1]` + l0 `o_lens[0]` + l1 `o_lens[1]`, and d alike, f and l in `[-1,1]`.
#[derive(Clone, Copy, Debug)]
pub struct FilmPatch {
    /// Origin and direction through the middle of both; the direction has depth 1 (orthographic: length 1).
    pub o: DVec3,
    /// See `o`.
    pub d: DVec3,
    /// By the position on the film, in units of half the rectangle.
    pub o_film: [DVec3; 2],
    /// See `o_film`.
    pub d_film: [DVec3; 2],
    /// By the position on the lens, in units of its radius; zero without a lens.
    pub o_lens: [DVec3; 2],
    /// See `o_lens`.
    pub d_lens: [DVec3; 2],
    /// Clip planes, in units of `d`.
    pub t: [f64; 2],
}

/// A camera, ready to generate rays.
#[derive(Clone, Debug)]
pub struct Camera {
    /// Position; the centre of the film for an orthographic camera.
    origin: DVec3,
    /// Camera x, y, z in the world; of unit length except x and y of an orthographic camera.
    axes: [DVec3; 3],
    /// Rows that give camera coordinates of a world offset.
    inverse: [DVec3; 3],
    /// 2 / width, 2 / height in camera space at depth 1, and the value at film position 0.
    step: [f64; 2],
    start: [f64; 2],
    /// Lens radius and depth of the plane in focus.
    lens: Option<(f64, f64)>,
    orthographic: bool,
    clip: [f64; 2],
}

impl Camera {
    /// Builds the camera. The error is a text without location (the reader adds it).
    pub fn new(desc: &CameraDesc, film: &FilmDesc) -> Result<Self, String> {
        if film.width == 0 || film.height == 0 {
            return Err(format!("the film has no pixels ({} x {})", film.width, film.height));
        }
        let [near, far] = [desc.near_clip, desc.far_clip];
        if !(near >= 0.0 && far > near) {
            return Err(format!("clip distances must satisfy 0 <= near < far, found {near} and {far}"));
        }
        let mut axes = columns(&desc.to_world)?;
        let inverse_of = desc.to_world.inverse();
        let aspect = film.width as f64 / film.height as f64;
        let (mut half, mut shift, mut lens) = (1.0, [0.0; 2], None);
        let orthographic = matches!(desc.projection, Projection::Orthographic);
        if let Projection::Perspective { x_fov, principal_point_offset, aperture_radius, focus_distance } =
            desc.projection
        {
            if !(x_fov > 0.0 && x_fov < PI) {
                let deg = x_fov.to_degrees();
                return Err(format!("the field of view must lie between 0 and 180 degrees, found {deg}"));
            }
            if !principal_point_offset.iter().all(|x| x.is_finite()) {
                return Err("the principal point must be finite".into());
            }
            half = (0.5 * x_fov).tan();
            shift = principal_point_offset;
            lens = lens_of(aperture_radius, focus_distance)?;
            // Rigid up to the rounding of the file: lengths of the axes would only stretch the clip distances.
            axes = axes.map(DVec3::normalize);
        }
        let inverse = if orthographic {
            let m = inverse_of.transpose();
            [m.x_axis, m.y_axis, m.z_axis].map(|r| r.truncate())
        } else {
            let m = glam::DMat3::from_cols(axes[0], axes[1], axes[2]).inverse().transpose();
            [m.x_axis, m.y_axis, m.z_axis]
        };
        let depth_scale = if orthographic { axes[2].length() } else { 1.0 };
        Ok(Camera {
            origin: desc.to_world.w_axis.truncate(),
            axes,
            inverse,
            step: [-2.0 * half / film.width as f64, -2.0 * half / aspect / film.height as f64],
            start: [half * (1.0 - 2.0 * shift[0]), half / aspect * (1.0 - 2.0 * shift[1])],
            lens,
            orthographic,
            clip: [near * depth_scale, far * depth_scale],
        })
    }

    /// Whether rays depend on the lens sample.
    pub fn has_lens(&self) -> bool {
        self.lens.is_some()
    }

    /// The ray through film position `film` (pixels of the full image, (0,0) top left) from lens sample `u_lens`.
    pub fn ray(&self, film: Vec2, u_lens: Vec2) -> CameraRay {
        let lens = if self.lens.is_some() { sample_disk(u_lens) } else { Vec2::ZERO };
        self.ray_from_lens(film, lens)
    }

    /// The ray through `film` from a point of the unit disk that stands for the lens.
    fn ray_from_lens(&self, film: Vec2, lens: Vec2) -> CameraRay {
        let x = self.start[0] + self.step[0] * film.x as f64;
        let y = self.start[1] + self.step[1] * film.y as f64;
        let [ax, ay, az] = self.axes;
        if self.orthographic {
            return CameraRay {
                o: (self.origin + ax * x + ay * y).as_vec3(),
                d: az.normalize().as_vec3(),
                tmin: self.clip[0] as f32,
                tmax: self.clip[1] as f32,
                film,
            };
        }
        // Offset of the lens point, and the direction to where the pinhole's ray meets the plane in focus, at depth 1.
        let (ox, oy, x, y) = match self.lens {
            Some((radius, focus)) => {
                let (ox, oy) = (lens.x as f64 * radius, lens.y as f64 * radius);
                (ox, oy, x - ox / focus, y - oy / focus)
            }
            None => (0.0, 0.0, x, y),
        };
        let d = ax * x + ay * y + az;
        // Distance per depth: the length of the direction whose depth is 1.
        let length = d.length();
        CameraRay {
            o: (self.origin + ax * ox + ay * oy).as_vec3(),
            d: (d / length).as_vec3(),
            tmin: (self.clip[0] * length) as f32,
            tmax: (self.clip[1] * length) as f32,
            film,
        }
    }

    /// The rays through the rectangle of the film around `centre` with half sizes `half` (pixels of the full image).
    #[inline(always)] // most of a large value is thrown away
    pub fn patch(&self, centre: [f64; 2], half: [f64; 2]) -> FilmPatch {
        let x = self.start[0] + self.step[0] * centre[0];
        let y = self.start[1] + self.step[1] * centre[1];
        let [ax, ay, az] = self.axes;
        let film = [ax * (self.step[0] * half[0]), ay * (self.step[1] * half[1])];
        let none = [DVec3::ZERO; 2];
        if self.orthographic {
            let (o, d) = (self.origin + ax * x + ay * y, az.normalize());
            return FilmPatch { o, d, o_film: film, d_film: none, o_lens: none, d_lens: none, t: self.clip };
        }
        let (o_lens, d_lens) = match self.lens {
            Some((radius, focus)) => ([ax * radius, ay * radius], [ax, ay].map(|a| a * (-radius / focus))),
            None => (none, none),
        };
        FilmPatch { o: self.origin, d: ax * x + ay * y + az, o_film: none, d_film: film, o_lens, d_lens, t: self.clip }
    }

    /// Film position at which the world point `p` is seen through the centre of the lens; `None` outside of the clip
    /// planes. The position may lie outside of the film.
    pub fn project(&self, p: Vec3) -> Option<Vec2> {
        let q = p.as_dvec3() - self.origin;
        let [x, y, z] = self.inverse.map(|row| row.dot(q));
        let depth = if self.orthographic { z * self.axes[2].length() } else { z };
        if !(depth > 0.0 && depth >= self.clip[0] && depth <= self.clip[1]) {
            return None;
        }
        let divisor = if self.orthographic { 1.0 } else { z };
        let film = |k: usize, x: f64| ((x / divisor - self.start[k]) / self.step[k]) as f32;
        Some(Vec2::new(film(0, x), film(1, y)))
    }
}

/// The three axes of a camera's matrix, checked to be usable.
fn columns(m: &DMat4) -> Result<[DVec3; 3], String> {
    if !m.is_finite() {
        return Err("the camera's matrix has entries that are not finite".into());
    }
    let axes = [m.x_axis, m.y_axis, m.z_axis].map(|a| a.truncate());
    let volume = axes[0].cross(axes[1]).dot(axes[2]).abs();
    let lengths: f64 = axes.iter().map(|a| a.length()).product();
    if !(lengths > 0.0 && volume > 1e-9 * lengths) {
        return Err("the camera's matrix is singular: its axes do not span the space".into());
    }
    Ok(axes)
}

fn lens_of(radius: f64, focus: f64) -> Result<Option<(f64, f64)>, String> {
    if !(radius >= 0.0 && radius.is_finite()) {
        return Err(format!("the lens radius must be 0 or more, found {radius}"));
    }
    if radius == 0.0 {
        return Ok(None);
    }
    if focus.is_nan() || focus <= 0.0 {
        return Err(format!("the focus distance must be above 0, found {focus}"));
    }
    Ok(Some((radius, focus)))
}

#[cfg(test)]
mod tests;
