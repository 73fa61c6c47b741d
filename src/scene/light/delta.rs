//! Lights without extent: points, spots and parallel light.
//!
//! They are reached by sampling only; their "density" is a delta function and does not appear. Intensities in W/sr,
//! irradiance in W/m^2. Spot: Mitsuba 3's ramp, linear in the angle between `beam_width` and `cutoff_angle`;
//! its texture covers the square around the cone at tangent `cutoff_angle`, u along +x and v along +y of the light.
//! Not handled: spots whose transform is no rotation (its axes are made orthonormal).

use crate::math::{DMat4, DVec3, Mat3, Rgb, Vec2, Vec3};
use crate::scene::description::{LightDesc, TextureId};
use crate::scene::texture::Textures;
use std::f64::consts::{PI, TAU};

/// A light without extent.
#[derive(Clone, Debug)]
pub enum DeltaLight {
    /// The same intensity in all directions.
    Point {
        /// Position.
        position: Vec3,
        /// Radiant intensity, W/sr.
        intensity: Rgb,
    },
    /// A cone round +z of the light.
    Spot {
        /// Position.
        position: Vec3,
        /// World to light.
        to_local: Mat3,
        /// Radiant intensity on the axis, W/sr.
        intensity: Rgb,
        /// Half angle beyond which nothing is emitted, radians.
        cutoff: f32,
        /// Half angle of full intensity, radians.
        beam: f32,
        /// Tangent of `cutoff`.
        tan_cutoff: f32,
        /// Factor over the cone.
        texture: Option<TextureId>,
    },
    /// Parallel light.
    Directional {
        /// Unit direction in which the light travels.
        direction: Vec3,
        /// Irradiance on a plane across it.
        irradiance: Rgb,
    },
}

/// Direction to a light, distance, and what arrives: intensity / distance^2 or irradiance.
#[derive(Clone, Copy, Debug)]
pub(super) struct Arrival {
    pub wi: Vec3,
    pub distance: f32,
    pub value: Rgb,
}

/// World-to-local rotation from a local-to-world matrix: z kept, y as near as can be, handedness kept.
pub(super) fn rotation_to_local(to_world: &DMat4) -> Mat3 {
    let [x, y, z] = [to_world.x_axis, to_world.y_axis, to_world.z_axis].map(|a| a.truncate());
    let z = z.normalize_or(DVec3::Z);
    let y = (y - z * y.dot(z)).normalize_or(z.any_orthonormal_vector());
    let side = y.cross(z);
    let side = if side.dot(x) < 0.0 { -side } else { side };
    Mat3::from_cols(side.as_vec3(), y.as_vec3(), z.as_vec3()).transpose()
}

impl DeltaLight {
    /// The light of a description, if it is one without extent.
    pub(super) fn new(desc: &LightDesc) -> Option<Self> {
        Some(match desc {
            LightDesc::Point { position, intensity } => {
                DeltaLight::Point { position: position.as_vec3(), intensity: *intensity }
            }
            LightDesc::Spot { to_world, intensity, cutoff_angle, beam_width, texture } => DeltaLight::Spot {
                position: to_world.w_axis.truncate().as_vec3(),
                to_local: rotation_to_local(to_world),
                intensity: *intensity,
                cutoff: *cutoff_angle as f32,
                beam: beam_width.min(*cutoff_angle) as f32,
                tan_cutoff: cutoff_angle.tan() as f32,
                texture: *texture,
            },
            LightDesc::Directional { direction, irradiance } => DeltaLight::Directional {
                direction: direction.normalize_or(DVec3::Z).as_vec3(),
                irradiance: *irradiance,
            },
            LightDesc::Constant { .. } | LightDesc::EnvMap { .. } => return None,
        })
    }

    /// Kind for [`super::LightInfo`].
    pub fn kind(&self) -> &'static str {
        match self {
            DeltaLight::Point { .. } => "point",
            DeltaLight::Spot { .. } => "spot",
            DeltaLight::Directional { .. } => "directional",
        }
    }

    /// What arrives at `p`; `None` where that is nothing.
    pub(super) fn arrival(&self, textures: Textures, p: Vec3) -> Option<Arrival> {
        let from = |position: Vec3| {
            let to = position - p;
            let d2 = to.length_squared();
            (d2 > 0.0).then(|| (to / d2.sqrt(), d2))
        };
        let (wi, distance, value) = match self {
            DeltaLight::Point { position, intensity } => {
                let (wi, d2) = from(*position)?;
                (wi, d2.sqrt(), *intensity / d2)
            }
            DeltaLight::Spot { position, intensity, .. } => {
                let (wi, d2) = from(*position)?;
                (wi, d2.sqrt(), *intensity * self.spot_factor(textures, -wi) / d2)
            }
            DeltaLight::Directional { direction, irradiance } => (-*direction, f32::INFINITY, *irradiance),
        };
        (value != Rgb::ZERO && value.is_finite()).then_some(Arrival { wi, distance, value })
    }

    /// Ramp times texture of a spot in the unit world direction `w` away from it; 1 for others.
    pub fn spot_factor(&self, textures: Textures, w: Vec3) -> Rgb {
        let DeltaLight::Spot { to_local, cutoff, beam, tan_cutoff, texture, .. } = self else {
            return Rgb::ONE;
        };
        let d = *to_local * w;
        // atan2 instead of acos: exact for narrow beams.
        let angle = d.truncate().length().atan2(d.z);
        let ramp = if angle <= *beam {
            1.0
        } else if angle < *cutoff {
            (cutoff - angle) / (cutoff - beam)
        } else {
            return Rgb::ZERO;
        };
        match texture {
            Some(id) => textures.eval(*id, Vec2::splat(0.5) + 0.5 * d.truncate() / (d.z * tan_cutoff)) * ramp,
            None => Rgb::splat(ramp),
        }
    }

    /// Emitted power, W; for parallel light what enters a sphere of `radius`. Exact, except that a spot's texture is
    /// integrated on a grid of 64 x 128 directions.
    pub fn power(&self, textures: Textures, radius: f32) -> Rgb {
        match self {
            DeltaLight::Point { intensity, .. } => *intensity * (2.0 * TAU) as f32,
            DeltaLight::Directional { irradiance, .. } => *irradiance * (PI as f32 * radius * radius),
            DeltaLight::Spot { intensity, cutoff, beam, texture: None, .. } => {
                let (c, b) = (*cutoff as f64, *beam as f64);
                // Integral of the ramp times sin; the mean of cos over the ramp, or its limit.
                let mean_cos = if c - b > 1e-6 { (c.sin() - b.sin()) / (c - b) } else { c.cos() };
                *intensity * (TAU * (1.0 - mean_cos)) as f32
            }
            DeltaLight::Spot { intensity, to_local, cutoff, .. } => {
                let (rings, steps) = (64, 128);
                let one_minus_cos = 1.0 - cutoff.cos();
                let mut sum = Rgb::ZERO;
                for i in 0..rings * steps {
                    let cos = 1.0 - one_minus_cos * ((i / steps) as f32 + 0.5) / rings as f32;
                    let phi = TAU as f32 * ((i % steps) as f32 + 0.5) / steps as f32;
                    let sin = (1.0 - cos * cos).max(0.0).sqrt();
                    let local = Vec3::new(sin * phi.cos(), sin * phi.sin(), cos);
                    sum += self.spot_factor(textures, to_local.transpose() * local);
                }
                *intensity * sum * (TAU as f32 * one_minus_cos / (rings * steps) as f32)
            }
        }
    }
}
