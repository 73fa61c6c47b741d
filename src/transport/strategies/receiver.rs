//! A shaded point, as sums over virtual lights see it.

use crate::math::{Rgb, Vec3};
use crate::scene::{Bsdf, SurfacePoint, Transport};
use crate::transport::vpl::{Vpl, Vpls, mean};
use std::f32::consts::FRAC_1_PI;

/// A surface point and the diffuse part of its material.
#[derive(Clone, Copy, Debug)]
pub struct Receiver<'a> {
    /// The point.
    pub at: &'a SurfacePoint,
    diffuse: &'a Bsdf,
    wo: Vec3,
    /// Normal and f times the weight, if the material is Lambertian.
    lambert: Option<(Vec3, Rgb)>,
    /// Nothing comes from below the plane across it.
    pub horizon: Option<Vec3>,
    /// What its light counts in the sample: the path's throughput.
    pub weight: Rgb,
    /// Largest f times the weight, mean of the channels, 1/sr.
    pub reach: f32,
    /// Segments of a light's way, least and most: 0 are lights on emitters.
    pub segments: [u32; 2],
    /// Rays traced from the eye to get here.
    pub eye_rays: u32,
}

impl<'a> Receiver<'a> {
    /// The point `at` seen from `wo`, whose light counts `weight` and has a number of `segments` within these bounds up to the virtual light.
    pub fn new(
        at: &'a SurfacePoint,
        diffuse: &'a Bsdf,
        wo: Vec3,
        weight: Rgb,
        segments: [u32; 2],
        eye_rays: u32,
    ) -> Self {
        let lambert = diffuse.lambert(wo).map(|(n, albedo)| (n, albedo * weight * FRAC_1_PI));
        let reach = match lambert {
            Some((_, f)) => mean(f),
            None => mean(diffuse.albedo(wo) * weight) * FRAC_1_PI,
        };
        Receiver {
            at,
            diffuse,
            wo,
            lambert,
            horizon: lambert.map_or_else(|| diffuse.upper_normal(), |l| Some(l.0)),
            weight,
            reach,
            segments,
            eye_rays,
        }
    }

    /// The tentative contribution of a light: all but its visibility, times the weight.
    #[inline]
    pub fn tentative(&self, vpls: &Vpls, light: &Vpl) -> Rgb {
        let d = light.p - self.at.p;
        let d2 = d.length_squared();
        let [least, most] = self.segments;
        if light.segments < least || light.segments > most || !(d2 > 0.0) {
            return Rgb::ZERO;
        }
        match self.lambert {
            Some((n, f)) => {
                let cos = d.dot(n);
                if cos <= 0.0 {
                    return Rgb::ZERO;
                }
                if light.is_lambertian() {
                    // What follows, without a root.
                    let facing = -light.n.dot(d);
                    if facing <= 0.0 || light.n_shade.dot(d) >= 0.0 {
                        return Rgb::ZERO;
                    }
                    return f * light.power * (cos * facing / (d2 * (d2 + light.radius2)));
                }
                f * vpls.arriving(light, -d, d2) * (cos / d2.sqrt())
            }
            None => {
                let wi = d / d2.sqrt();
                self.diffuse.eval(self.wo, wi, Transport::Radiance) * self.weight * vpls.arriving(light, -d, d2)
            }
        }
    }

    /// The normal by which cache points are compared.
    pub fn normal(&self) -> Vec3 {
        let n = self.horizon.unwrap_or(self.at.n_geo);
        if n.dot(self.wo) < 0.0 && self.horizon.is_none() { -n } else { n }
    }
}
