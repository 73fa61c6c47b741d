//! A lobe in its frame with its weight: local directions, maps of normals, and what depends on the kind of transport.

use super::diffuse::Lambert;
use super::lobe::{Lobe, LobeSample};
use super::{BsdfSample, LobeKind, Transport};
use crate::math::{Frame, Rgb, Vec2, Vec3, warp};

/// A weighted lobe and the frame it lives in.
#[derive(Clone, Debug)]
pub struct Layer {
    /// Shading frame; left-handed on the back of two-sided materials.
    pub frame: Frame,
    /// Share of the lobe.
    pub weight: f32,
    /// What a bump or normal map did to the frame.
    pub perturbation: Option<Perturbation>,
    /// The lobe.
    pub lobe: Lobe,
}

/// A shading normal changed by a map, and the shadowing that hides the seam of its terminator
/// (Conty Estevez et al. 2019, "A Microfacet-Based Shadowing Function to Solve the Bump Terminator Problem").
#[derive(Clone, Copy, Debug)]
pub struct Perturbation {
    /// Normal before.
    n: Vec3,
    /// Squared roughness of the facets whose shadowing is used.
    alpha2: f32,
}

impl Perturbation {
    /// From the normals before and after, on the side of the layer's frame.
    pub fn new(before: Vec3, after: Vec3) -> Self {
        let tan2 = tan2(before.dot(after));
        Perturbation { n: before, alpha2: (0.125 * tan2).min(1.0) }
    }

    /// Factor on light that comes from `d`.
    fn shadowing(&self, d: Vec3) -> f32 {
        2.0 / (1.0 + (1.0 + self.alpha2 * tan2(d.dot(self.n))).sqrt())
    }
}

fn tan2(cos: f32) -> f32 {
    let cos2 = (cos * cos).max(1e-12);
    (1.0 - cos2).max(0.0) / cos2
}

impl Layer {
    /// A plain diffuse layer of weight 1.
    pub fn lambert(n: Vec3, reflectance: Rgb) -> Self {
        Layer {
            frame: Frame::from_normal(n),
            weight: 1.0,
            perturbation: None,
            lobe: Lobe::Lambert(Lambert { reflectance }),
        }
    }

    /// f |cos| with all factors but the layer's weight, and pdf.
    pub fn eval(&self, n_geo: Vec3, wo: Vec3, wi: Vec3, transport: Transport) -> (Rgb, f32) {
        let (o, i) = (self.frame.to_local(wo), self.frame.to_local(wi));
        let (f, pdf) = self.lobe.eval(o, i);
        if pdf <= 0.0 || !self.same_side(wi, i.z) {
            return (Rgb::ZERO, 0.0);
        }
        let eta = if o.z * i.z < 0.0 { self.lobe.relative_eta(o.z) } else { 1.0 };
        (f * self.factor(n_geo, (wo, o.z), (wi, i.z), eta, transport), pdf)
    }

    /// Draws a direction (local) with its world direction and, for Dirac lobes, the factor on its value.
    pub fn sample(
        &self,
        n_geo: Vec3,
        wo: Vec3,
        u_lobe: f32,
        u: Vec2,
        transport: Transport,
    ) -> Option<(LobeSample, Vec3, f32)> {
        if matches!(self.lobe, Lobe::Null) {
            let s = self.lobe.sample(wo, u_lobe, u)?;
            return Some((s, -wo, 1.0));
        }
        let o = self.frame.to_local(wo);
        let s = self.lobe.sample(o, u_lobe, u)?;
        let wi = self.frame.to_world(s.wi);
        if !self.same_side(wi, s.wi.z) {
            return None;
        }
        let factor = match s.dirac {
            Some(_) => self.factor(n_geo, (wo, o.z), (wi, s.wi.z), s.eta, transport),
            None => 1.0,
        };
        Some((s, wi, factor))
    }

    /// What [`super::Bsdf::sample`] does for radiance if this layer, a plain diffuse one, is alone: its weight is its
    /// albedo.
    pub fn sample_lambert(&self, lobe: &Lambert, wo: Vec3, u: Vec2) -> Option<BsdfSample> {
        let weight = self.weight * lobe.reflectance;
        if wo.dot(self.frame.n) <= 0.0 || weight.max_element() <= 0.0 {
            return None;
        }
        let local = warp::sample_cosine_hemisphere(u);
        Some(BsdfSample {
            wi: self.frame.to_world(local),
            weight,
            pdf_dir: warp::pdf_cosine_hemisphere(local),
            lobe: LobeKind::Diffuse,
            eta: 1.0,
            pmf: 1.0,
        })
    }

    /// Share of light scattered, for choosing among layers.
    pub fn albedo(&self, wo: Vec3) -> Rgb {
        self.weight * self.lobe.albedo(self.frame.to_local(wo))
    }

    /// False if a map turned the normal so far that `wi` (cosine `cos`) is on one side of it and on the other side of
    /// the surface.
    fn same_side(&self, wi: Vec3, cos: f32) -> bool {
        match &self.perturbation {
            None => true,
            Some(p) => cos * wi.dot(p.n) > 0.0,
        }
    }

    /// All that distinguishes the transport of radiance from that of importance (module docs), and shadowing under maps.
    /// Directions come with their cosines in this frame.
    fn factor(
        &self,
        n_geo: Vec3,
        (wo, cos_o): (Vec3, f32),
        (wi, cos_i): (Vec3, f32),
        eta: f32,
        transport: Transport,
    ) -> f32 {
        let (light, mut factor) = match transport {
            Transport::Radiance => (wi, 1.0 / (eta * eta)),
            Transport::Importance => {
                let denom = wo.dot(n_geo) * cos_i;
                let veach = (cos_o * wi.dot(n_geo) / denom).abs();
                (wo, if denom.abs() > 1e-9 && veach.is_finite() { veach } else { 0.0 })
            }
        };
        if let Some(p) = &self.perturbation {
            factor *= p.shadowing(light);
        }
        factor
    }
}
