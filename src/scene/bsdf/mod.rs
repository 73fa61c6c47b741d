//! Bidirectional scattering: a material at one point, as sample / pdf / eval trios.
//!
//! A [`Bsdf`] is a weighted sum of lobes, each a model in its own local frame; cosines are those of the *shading* frame
//! only, as in Mitsuba: no direction is refused because the geometric normal disagrees.
//!
//! ```text
//! eval(wo, wi)  = sum_l w_l f_l(wo, wi) |cos_l(wi)| c_l(wo, wi)          over lobes with a density
//! pdf_dir       = sum_l p_l(wo) pdf_l(wo, wi),   p_l ~ w_l luminance(albedo_l(wo))      per solid angle of wi
//! c_l           = 1 / eta^2  for radiance that crosses a boundary        (Veach 1997, section 5.2)
//!                 |wo.n_l wi.n_geo| / |wo.n_geo wi.n_l| for importance   (Veach 1997, section 5.3)
//! ```
//!
//! c_l is applied in `layer.rs` only; lobes know nothing of it. The three functions agree for any `wo` on the side the
//! `Bsdf` was made for (two-sided materials and maps choose their frame by that side).
//! Bias: none beyond that of the models. Not handled: the flip of normals under bump and normal maps depends on the side
//! `wo` sees, so for importance it is not the exact adjoint where such a flip happens.
//! Verified by `tests/`: chi-square, weight = value / pdf, reciprocity, adjoint, energy, agreement with Mitsuba 3.9.1.

mod conductor;
mod dielectric;
mod diffuse;
mod erf;
mod fresnel;
mod layer;
mod lobe;
mod microfacet;
mod plastic;
mod resolve;
mod rough_transmittance;
#[cfg(test)]
mod tests;
mod view;

use self::layer::Layer;
use self::lobe::Lobe;
use self::resolve::{MAX_LAYERS, Resolver};
use self::view::{State, View, valid_color};
use super::material::Material;
use super::surface::SurfacePoint;
use super::texture::Textures;
use crate::math::{Rgb, Vec2, Vec3, luminance};
use arrayvec::ArrayVec;

/// The largest float below 1: keeps remapped random numbers in [0, 1).
const ONE_MINUS_EPSILON: f32 = 1.0 - f32::EPSILON * 0.5;

/// `x` in [low, high]; `low` for NaN.
fn clamp_or_low(x: f32, low: f32, high: f32) -> f32 {
    if x.is_nan() { low } else { x.clamp(low, high) }
}

/// What a path carries. Radiance scales with the squared index when it crosses a boundary, photon power does not;
/// and with shading normals the adjoint needs Veach's factor (1997, section 5.3). Both are applied here only.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Transport {
    /// Path from the eye; `wo` points to where radiance flows.
    Radiance,
    /// Path from a light; `wo` points back to where the photon came from.
    Importance,
}

/// Kind of a scattering lobe.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LobeKind {
    /// Diffuse: stores photons.
    Diffuse,
    /// Rough reflection or refraction.
    Glossy,
    /// Perfectly specular reflection or refraction (a Dirac lobe).
    Specular,
    /// Straight through, as if there were no surface.
    Null,
}

/// A sampled direction.
#[derive(Clone, Copy, Debug)]
pub struct BsdfSample {
    /// Direction away from the surface, world, unit.
    pub wi: Vec3,
    /// f |cos| / pdf over all lobes (for Dirac lobes: their weight over the probability of choosing them).
    pub weight: Rgb,
    /// Density per solid angle over all non-Dirac lobes; 0 for Dirac lobes (`lobe` tells).
    pub pdf_dir: f32,
    /// The lobe that was sampled.
    pub lobe: LobeKind,
    /// Relative index crossed (transmitted over incident side), 1 without refraction.
    pub eta: f32,
    /// Probability of having chosen this Dirac lobe; 1 for lobes with a density.
    pub pmf: f32,
}

/// A material at a point: textures evaluated, nesting resolved into weighted lobes.
/// `wo` and `wi` are world unit vectors that point away from the surface.
#[derive(Clone, Debug)]
pub struct Bsdf {
    n_geo: Vec3,
    /// Most materials are one lobe; `rest` then allocates nothing.
    first: Layer,
    rest: Vec<Layer>,
}

impl Bsdf {
    /// The material `id` at `at`, seen from `wo`.
    pub fn new(materials: &[Material], id: u32, textures: Textures, at: &SurfacePoint, wo: Vec3) -> Self {
        // The usual cases first: a single lobe on one or two sides, and above all a diffuse one.
        let (leaf, n, two_sided) = match &materials[id as usize] {
            Material::TwoSided { front, .. } if wo.dot(at.n_shade) >= 0.0 => (*front, at.n_shade, true),
            Material::TwoSided { back, .. } => (*back, -at.n_shade, true),
            _ => (id, at.n_shade, false),
        };
        let leaf = &materials[leaf as usize];
        if let Material::Diffuse { reflectance } = leaf {
            let reflectance = valid_color(textures.color(reflectance, at.uv));
            return Bsdf { n_geo: at.n_geo, first: Layer::lambert(n, reflectance), rest: Vec::new() };
        }
        let view = View { textures, at, wo };
        let root = State::new(at);
        let state = if two_sided { root.turned_to(wo).1 } else { root };
        if let Some(lobe) = view.lobe(leaf) {
            return Bsdf { n_geo: at.n_geo, first: view.layer(&state, leaf, lobe), rest: Vec::new() };
        }
        let mut layers = Resolver::new(materials, &view).run(id, root);
        let first = match layers.is_empty() {
            true => Layer::lambert(at.n_shade, Rgb::ZERO),
            false => layers.swap_remove(0),
        };
        Bsdf { n_geo: at.n_geo, first, rest: layers }
    }

    /// f(wo, wi) |cos(n_shade, wi)|, Dirac lobes excluded.
    pub fn eval(&self, wo: Vec3, wi: Vec3, transport: Transport) -> Rgb {
        self.eval_pdf(wo, wi, transport).0
    }

    /// Density per solid angle with which [`Self::sample`] draws `wi`, Dirac lobes excluded.
    pub fn pdf_dir(&self, wo: Vec3, wi: Vec3) -> f32 {
        self.eval_pdf(wo, wi, Transport::Radiance).1
    }

    /// [`Self::eval`] and [`Self::pdf_dir`] at once.
    pub fn eval_pdf(&self, wo: Vec3, wi: Vec3, transport: Transport) -> (Rgb, f32) {
        if self.rest.is_empty() {
            let (f, pdf) = self.first.eval(self.n_geo, wo, wi, transport);
            return (self.first.weight * f, pdf);
        }
        let (mut f, mut pdf, mut total) = (Rgb::ZERO, 0.0, 0.0);
        for layer in self.layers() {
            let share = luminance(layer.albedo(wo));
            total += share;
            if share > 0.0 && !layer.lobe.is_dirac() {
                let (value, density) = layer.eval(self.n_geo, wo, wi, transport);
                f += layer.weight * value;
                pdf += share * density;
            }
        }
        if pdf > 0.0 { (f, pdf / total) } else { (Rgb::ZERO, 0.0) }
    }

    /// Draws a direction. `u_lobe` chooses the lobe, `u` the direction within.
    pub fn sample(&self, wo: Vec3, u_lobe: f32, u: Vec2, transport: Transport) -> Option<BsdfSample> {
        if let (Lobe::Lambert(l), None, true) = (&self.first.lobe, self.first.perturbation, self.rest.is_empty())
            && transport == Transport::Radiance
        {
            return self.first.sample_lambert(l, wo, u);
        }
        let (layer, share, u_lobe) = self.choose(wo, u_lobe)?;
        let (s, wi, factor) = layer.sample(self.n_geo, wo, u_lobe, u, transport)?;
        let (weight, pdf_dir, pmf) = match s.dirac {
            Some((value, pmf)) => (value * (layer.weight * factor / (share * pmf)), 0.0, share * pmf),
            None => {
                let (f, pdf) = self.eval_pdf(wo, wi, transport);
                (f / pdf, pdf, 1.0)
            }
        };
        // Also false for NaN, of pdf 0 or else.
        let usable = weight.is_finite() && weight.max_element() > 0.0 && pdf_dir.is_finite();
        usable.then_some(BsdfSample { wi, weight, pdf_dir, lobe: s.kind, eta: s.eta, pmf })
    }

    /// All directions of a smooth material, mirrored and refracted, each with its full value, where [`Self::sample`] would
    /// choose one by chance. `None` unless the material is a single Dirac lobe.
    pub fn branches(&self, wo: Vec3, transport: Transport) -> Option<ArrayVec<BsdfSample, 2>> {
        if !self.rest.is_empty() || !self.first.lobe.is_dirac() {
            return None;
        }
        let mut all = ArrayVec::<BsdfSample, 2>::new();
        for u_lobe in [0.0, ONE_MINUS_EPSILON] {
            let Some((s, wi, factor)) = self.first.sample(self.n_geo, wo, u_lobe, Vec2::splat(0.5), transport) else {
                continue;
            };
            let Some((value, _)) = s.dirac else { continue };
            let weight = value * (self.first.weight * factor);
            let known = all.last().is_some_and(|first: &BsdfSample| first.wi == wi);
            if !known && weight.is_finite() && weight.max_element() > 0.0 {
                all.push(BsdfSample { wi, weight, pdf_dir: 0.0, lobe: s.kind, eta: s.eta, pmf: 1.0 });
            }
        }
        Some(all)
    }

    /// Chooses a layer in proportion to its albedo: the layer, its probability, and what is left of the random number.
    fn choose(&self, wo: Vec3, u: f32) -> Option<(&Layer, f32, f32)> {
        if self.rest.is_empty() {
            return Some((&self.first, 1.0, u));
        }
        let shares: ArrayVec<f32, MAX_LAYERS> = self.layers().map(|l| luminance(l.albedo(wo))).collect();
        let total: f32 = shares.iter().sum();
        let mut x = u * total;
        let mut chosen = None;
        for (layer, &share) in self.layers().zip(&shares) {
            if share > 0.0 {
                // Rounding may leave x beyond the last layer: it stays with the last that can be chosen.
                chosen = Some((layer, share / total, (x / share).clamp(0.0, ONE_MINUS_EPSILON)));
                if x < share {
                    break;
                }
                x -= share;
            }
        }
        chosen
    }

    /// The diffuse part, whose light comes from irradiance, and the rest, which depends on single directions: Dirac and
    /// glossy lobes, coats. Their values add up to this material's; each draws from its own lobes only.
    pub fn split(self) -> (Option<Bsdf>, Option<Bsdf>) {
        if let (Lobe::Lambert(_), true) = (&self.first.lobe, self.rest.is_empty()) {
            return (Some(self), None);
        }
        let n_geo = self.n_geo;
        if self.rest.is_empty() {
            // One lobe, as most materials have: nothing is allocated.
            let layer = self.first;
            let [d, r] = layer.lobe.split();
            let part = |lobe| Bsdf { n_geo, first: Layer { lobe, ..layer }, rest: Vec::new() };
            return (d.filter(Lobe::has_diffuse).map(part), r.map(part));
        }
        let (mut diffuse, mut rest) = (Vec::new(), Vec::new());
        for layer in std::iter::once(self.first).chain(self.rest) {
            let [d, r] = layer.lobe.split();
            let part = |lobe| Layer { lobe, ..layer };
            diffuse.extend(d.filter(Lobe::has_diffuse).map(part));
            rest.extend(r.map(part));
        }
        let bsdf = |mut layers: Vec<Layer>| {
            let first = if layers.is_empty() { None } else { Some(layers.swap_remove(0)) };
            first.map(|first| Bsdf { n_geo, first, rest: layers })
        };
        (bsdf(diffuse), bsdf(rest))
    }

    /// Normal and albedo, if this is plain Lambert: f |cos| = albedo / pi max(0, n . wi) for this `wo`.
    pub fn lambert(&self, wo: Vec3) -> Option<(Vec3, Rgb)> {
        let n = self.first.frame.n;
        let mut albedo = Rgb::ZERO;
        for layer in self.layers() {
            match &layer.lobe {
                Lobe::Lambert(l) if layer.perturbation.is_none() && layer.frame.n == n => {
                    albedo += layer.weight * l.reflectance;
                }
                _ => return None,
            }
        }
        Some((n, if wo.dot(n) > 0.0 { albedo } else { Rgb::ZERO }))
    }

    /// The unit normal above whose plane all directions lie from which light is scattered, Dirac lobes excluded; `None` if
    /// there is no such plane (rough glass, layers with different normals).
    pub fn upper_normal(&self) -> Option<Vec3> {
        let mut normal = None;
        for layer in self.layers().filter(|l| !l.lobe.is_dirac()) {
            let n = layer.frame.n;
            if matches!(layer.lobe, Lobe::RoughGlass(_)) || normal.is_some_and(|other| other != n) {
                return None;
            }
            normal = Some(n);
        }
        normal
    }

    /// Whether all lobes are diffuse, Dirac lobes excluded.
    pub fn is_matte(&self) -> bool {
        self.layers()
            .all(|l| l.lobe.is_dirac() || matches!(l.lobe, Lobe::Lambert(_) | Lobe::OrenNayar(_) | Lobe::Plastic(_)))
    }

    /// Whether a lobe is a Dirac or null lobe.
    pub fn has_dirac_lobe(&self) -> bool {
        self.layers().any(|l| l.lobe.is_dirac())
    }

    /// Share of light that passes straight through (weight of the null lobes).
    pub fn straight_through(&self) -> f32 {
        self.layers().filter(|l| matches!(l.lobe, lobe::Lobe::Null)).map(|l| l.weight).sum()
    }

    /// True if every lobe is a Dirac or null lobe: light sampling is of no use.
    pub fn is_delta(&self) -> bool {
        self.layers().all(|l| l.lobe.is_dirac())
    }

    /// True if a lobe is diffuse: worth storing photons.
    pub fn has_diffuse(&self) -> bool {
        self.layers().any(|l| l.lobe.has_diffuse())
    }

    /// Roughness (Beckmann or GGX alpha) of the sharpest lobe: 0 with specular ones, at most 1, the value of diffuse and
    /// of null lobes.
    pub fn min_alpha(&self) -> f32 {
        self.layers().map(|l| l.lobe.min_alpha()).fold(1.0, f32::min)
    }

    /// Roughness of the sharpest lobe with a density, at most 1; specular and null lobes do not count.
    pub fn min_glossy_alpha(&self) -> f32 {
        self.layers().filter(|l| !l.lobe.is_dirac()).map(|l| l.lobe.min_alpha()).fold(1.0, f32::min)
    }

    /// Hemispherical albedo, approximate (for the albedo layer and photon storage).
    pub fn albedo(&self, wo: Vec3) -> Rgb {
        self.layers().map(|l| l.albedo(wo)).sum()
    }

    fn layers(&self) -> impl Iterator<Item = &Layer> {
        std::iter::once(&self.first).chain(&self.rest)
    }
}
