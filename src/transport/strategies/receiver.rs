//! A shaded point, as sums over virtual lights see it.

use crate::math::{Rgb, Vec3};
use crate::scene::{Bsdf, SurfacePoint, Transport};
use crate::transport::eight::{Eight, WIDTH, Wide, all, dot, splat3};
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

    /// The same of the eight lights with these indices, by channels.
    #[inline(always)]
    pub(super) fn tentative_eight<W: Wide>(&self, vpls: &Vpls, indices: &[u32; WIDTH]) -> [Eight; 3] {
        let mut t = [all(0.0); 3];
        // Lanes for which the arithmetic below does not hold.
        let mut others = (1 << WIDTH) - 1;
        if let Some((n, f)) = self.lambert {
            let zero = W::splat(0.0);
            let lights = vpls.eight(indices);
            let p = splat3::<W>(self.at.p);
            let x = W::load(&lights.p[0]).minus(p[0]);
            let y = W::load(&lights.p[1]).minus(p[1]);
            let z = W::load(&lights.p[2]).minus(p[2]);
            let d = [x, y, z];
            let d2 = x.times(x).plus(y.times(y)).plus(z.times(z));
            let n = splat3::<W>(n);
            let cos = x.times(n[0]).plus(y.times(n[1])).plus(z.times(n[2]));
            let facing = zero.minus(dot(&lights.n, &d));
            let lit = W::both(W::both(zero.below(cos), zero.below(facing)), dot(&lights.n_shade, &d).below(zero));
            let lit = W::both(lit, zero.below(d2));
            let g = cos.times(facing).over(d2.times(d2.plus(W::load(&lights.radius2)))).kept(lit);
            let f = splat3::<W>(f);
            for channel in 0..3 {
                t[channel] = f[channel].times(W::load(&lights.power[channel])).times(g).store();
            }
            others = 0;
            let [least, most] = self.segments;
            for (k, &i) in indices.iter().enumerate() {
                let light = &vpls.lights[i as usize];
                let plain = light.is_lambertian() & (light.segments >= least) & (light.segments <= most);
                others |= u32::from(!plain) << k;
            }
        }
        while others != 0 {
            let k = others.trailing_zeros() as usize;
            others &= others - 1;
            let one = self.tentative(vpls, &vpls.lights[indices[k] as usize]);
            (0..3).for_each(|channel| t[channel][k / 4][k % 4] = one[channel]);
        }
        t
    }

    /// The normal by which cache points are compared.
    pub fn normal(&self) -> Vec3 {
        let n = self.horizon.unwrap_or(self.at.n_geo);
        if n.dot(self.wo) < 0.0 && self.horizon.is_none() { -n } else { n }
    }
}
