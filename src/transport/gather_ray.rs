//! One gather ray: from a point over specular surfaces to where its radiance comes from irradiance.
//!
//! Estimates   L_ind(x, w) = weight / pi x E(end) + sum of `glossy_direct`, E = irradiance at the end of the ray
//! Meaning     light that an emitter or the environment sends to x directly, or by specular reflection and refraction
//!             alone, counts zero: it belongs to direct light and to the caustic map
//! Chain       a surface is split into its diffuse part and the rest. The ray ends on the diffuse part with the
//!             probability p_d = albedo_d / (albedo_d + albedo_rest) and weight T albedo_d / p_d; else it follows a sample
//!             of the rest with T f cos / (pdf (1 - p_d)). Where the rest is not [`nearly_specular`],
//!             lamps light it: by a light sample, and by what the ray meets next, with the power heuristic (the ray's
//!             density is (1 - p_d) pdf): [`glossy_direct`]
//! Measure     light and BSDF densities per solid angle at the surface they belong to
//! Source      Jensen 1996, "Global Illumination using Photon Maps" (the split of light); Yue, Onoue and Nishita
//! Bias        the diffuse part answers with its albedo towards the ray, whatever the direction its light comes from (exact
//!             for Lambert; a coat's transmittance for the incident direction is taken at its mean). Chains longer than
//!             [`MAX_CHAIN`] end
//! Verified by tests/irradiance_cache.rs: closed furnaces with Lambert, mirror and mixed walls

use super::cache_file::{Stored, stored};
use super::light_tree::LitPoint;
use super::{World, nearly_specular, power_heuristic};
use crate::accel::Ray;
use crate::math::{Rgb, Sampler, Vec2, Vec3, luminance};
use crate::scene::{LightSample, LobeKind, SurfacePoint, Transport};
use rayon::prelude::*;

/// Most surfaces that a gather ray is reflected by or passes.
pub const MAX_CHAIN: u32 = 24;

/// Where a gather ray ended on a diffuse surface.
#[derive(Clone, Copy, Debug)]
pub struct DiffuseEnd {
    /// The surface.
    pub at: SurfacePoint,
    /// Towards where the ray came from, unit.
    pub wo: Vec3,
    /// Throughput of the chain times the albedo there.
    pub weight: Rgb,
}

/// Light that a gather ray gets by a rough glossy surface, in a form that another light can evaluate anew.
#[derive(Clone, Copy, Debug)]
pub enum GlossyLight {
    /// The surface, to be lit by a light sample.
    Vertex {
        /// The surface.
        at: SurfacePoint,
        /// Towards where the ray came from, unit.
        wo: Vec3,
        /// Throughput up to there.
        throughput: Rgb,
    },
    /// What the ray met after it: possibly a lamp, or what lies at infinity (`None`).
    Met {
        /// The surface that was met.
        at: Option<SurfacePoint>,
        /// Direction of the ray, unit.
        d: Vec3,
        /// The glossy surface it came from.
        from: Vec3,
        /// Density per solid angle with which the direction was drawn there.
        pdf_dir: f32,
        /// Throughput up to here.
        throughput: Rgb,
    },
}

impl GlossyLight {
    /// The same with its throughput times `factor`.
    pub fn scaled(mut self, factor: f32) -> Self {
        match &mut self {
            GlossyLight::Vertex { throughput, .. } | GlossyLight::Met { throughput, .. } => *throughput *= factor,
        }
        self
    }
}

/// What a gather ray found.
#[derive(Clone, Copy, Debug)]
pub struct GatherEnd {
    /// Length of the whole chain up to the end, infinite for rays that leave the scene.
    pub distance: f32,
    /// Length of its last part, after the last surface that has reflected or refracted it.
    pub last: f32,
    /// Length of the chain up to the first rough glossy surface, which glows like a diffuse one to those who move, else up to the end.
    pub depth: f32,
    /// Rays of the chain.
    pub segments: u32,
    /// Length of the first of them and normal where it ended, towards it.
    pub first: (f32, Vec3),
    /// Geometric normal at that depth towards the ray, where the chain has no corner before; else against the first direction.
    pub normal: Vec3,
    /// The diffuse surface at its end, `None` if the ray left the scene or was absorbed.
    pub end: Option<DiffuseEnd>,
}

/// Rays and shadow rays traced.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct RayCounts {
    /// Closest-hit rays.
    pub rays: u64,
    /// Shadow rays.
    pub shadow_rays: u64,
}

impl RayCounts {
    /// All rays.
    pub fn total(&self) -> u64 {
        self.rays + self.shadow_rays
    }
}

impl std::ops::Add for RayCounts {
    type Output = Self;
    fn add(mut self, o: Self) -> Self {
        self += o;
        self
    }
}

impl std::ops::Sub for RayCounts {
    type Output = Self;
    fn sub(self, o: Self) -> Self {
        RayCounts { rays: self.rays - o.rays, shadow_rays: self.shadow_rays - o.shadow_rays }
    }
}

stored!(RayCounts { rays, shadow_rays });
stored!(SurfacePoint { p, p_error, n_geo, n_shade, uv, dp_du, dp_dv, shape, prim });

impl Stored for GlossyLight {
    fn put(&self, out: &mut Vec<u8>) {
        match *self {
            GlossyLight::Vertex { at, wo, throughput } => {
                0u8.put(out);
                at.put(out);
                wo.put(out);
                throughput.put(out);
            }
            GlossyLight::Met { at, d, from, pdf_dir, throughput } => {
                1u8.put(out);
                at.put(out);
                d.put(out);
                from.put(out);
                pdf_dir.put(out);
                throughput.put(out);
            }
        }
    }

    fn take(f: &mut &[u8]) -> Option<Self> {
        Some(match u8::take(f)? {
            0 => GlossyLight::Vertex { at: Stored::take(f)?, wo: Stored::take(f)?, throughput: Stored::take(f)? },
            1 => GlossyLight::Met {
                at: Stored::take(f)?,
                d: Stored::take(f)?,
                from: Stored::take(f)?,
                pdf_dir: Stored::take(f)?,
                throughput: Stored::take(f)?,
            },
            _ => return None,
        })
    }
}

impl std::ops::AddAssign for RayCounts {
    fn add_assign(&mut self, o: RayCounts) {
        self.rays += o.rays;
        self.shadow_rays += o.shadow_rays;
    }
}

impl World<'_> {
    /// Follows a gather ray from `o` along the unit vector `d`; `on_glossy` is told of light by rough glossy surfaces.
    pub fn gather(
        &self,
        o: Vec3,
        d: Vec3,
        rng: &mut Sampler,
        counts: &mut RayCounts,
        mut on_glossy: impl FnMut(GlossyLight),
    ) -> GatherEnd {
        let mut ray = Ray { o, d, tmin: f32::MIN_POSITIVE, tmax: f32::INFINITY };
        let mut found = GatherEnd {
            distance: 0.0,
            last: 0.0,
            depth: 0.0,
            segments: 0,
            first: (f32::INFINITY, -d),
            normal: -d,
            end: None,
        };
        let (mut throughput, mut straight, mut seen_through) = (Rgb::ONE, true, true);
        // Where the last glossy direction was drawn, and with what density.
        let mut glossy: Option<(Vec3, f32)> = None;
        for _ in 0..MAX_CHAIN {
            counts.rays += 1;
            let Some(hit) = self.accel.closest(&ray) else {
                found.distance = f32::INFINITY;
                if seen_through {
                    found.depth = f32::INFINITY;
                }
                if let Some((from, pdf_dir)) = glossy
                    && self.scene.lights.has_environment()
                {
                    on_glossy(GlossyLight::Met { at: None, d: ray.d, from, pdf_dir, throughput });
                }
                return found;
            };
            found.distance += hit.t;
            found.last += hit.t;
            found.segments += 1;
            if seen_through {
                found.depth += hit.t;
            }
            let at = self.surface(&ray, &hit);
            let wo = -ray.d;
            let n_geo = if at.n_geo.dot(wo) < 0.0 { -at.n_geo } else { at.n_geo };
            if straight {
                found.normal = n_geo;
            }
            if found.segments == 1 {
                found.first = (hit.t, n_geo);
            }

            if let Some((from, pdf_dir)) = glossy
                && self.scene.shapes[at.shape as usize].emission.is_some()
            {
                on_glossy(GlossyLight::Met { at: Some(at), d: ray.d, from, pdf_dir, throughput });
            }

            let (diffuse, rest) = self.bsdf(&at, wo).split();
            let albedo = diffuse.map_or(Rgb::ZERO, |b| b.albedo(wo));
            let Some(rest) = rest else {
                found.end = usable(DiffuseEnd { at, wo, weight: throughput * albedo });
                return found;
            };
            let rough = !rest.is_delta() && !nearly_specular(&rest, LobeKind::Glossy);
            if rough {
                (straight, seen_through) = (false, false);
                on_glossy(GlossyLight::Vertex { at, wo, throughput });
            }
            let [ux, uy, u_lobe, u_end] = rng.next_4d();
            let (d_share, r_share) = (luminance(albedo), luminance(rest.albedo(wo)));
            let p_end = if d_share > 0.0 { d_share / (d_share + r_share) } else { 0.0 };
            if u_end < p_end {
                found.end = usable(DiffuseEnd { at, wo, weight: throughput * albedo / p_end });
                return found;
            }
            let Some(s) = rest.sample(wo, u_lobe, Vec2::new(ux, uy), Transport::Radiance) else { return found };
            throughput *= s.weight / (1.0 - p_end);
            if s.lobe != LobeKind::Null {
                found.last = 0.0;
                // The light sample at the vertex competes with its own lobe only where that has a density.
                glossy = (rough && s.pdf_dir > 0.0).then_some((at.p, s.pdf_dir * (1.0 - p_end)));
                if straight {
                    straight = false;
                    found.normal = -d;
                }
            }
            ray = Ray::leaving(&at, s.wi);
        }
        found
    }
}

fn usable(end: DiffuseEnd) -> Option<DiffuseEnd> {
    (end.weight.is_finite() && end.weight.max_element() > 0.0).then_some(end)
}

/// [`glossy_direct`] of vertices from number `start` on, each with random numbers of its own from `key`; and the rays that took.
pub fn light_glossy(world: &World, key: u64, glossy: &[(u32, GlossyLight)], start: usize) -> (Vec<Rgb>, RayCounts) {
    let lit: Vec<(Rgb, RayCounts)> = glossy[start..]
        .par_iter()
        .enumerate()
        .with_min_len(256)
        .map(|(i, (_, vertex))| {
            let mut counts = RayCounts::default();
            let mut rng = Sampler::new(key, (start + i) as u64, 0);
            (glossy_direct(world, vertex, &mut rng, &mut counts), counts)
        })
        .collect();
    let counts = lit.iter().fold(RayCounts::default(), |sum, (_, counts)| sum + *counts);
    (lit.into_iter().map(|(value, _)| value).collect(), counts)
}

/// Throughput times radiance: of a vertex by one light sample of what the rest of its material scatters, of what was met by
/// its emission; the two weighted by the power heuristic.
pub fn glossy_direct(world: &World, light: &GlossyLight, rng: &mut Sampler, counts: &mut RayCounts) -> Rgb {
    let value = match light {
        GlossyLight::Vertex { at, wo, throughput } => *throughput * scattered(world, at, *wo, rng, counts),
        GlossyLight::Met { at, d, from, pdf_dir, throughput } => {
            let scene = world.scene;
            let (radiance, pdf_light) = match at {
                Some(at) => (
                    scene.lights.emitted(&scene.shapes, scene.textures(), at, -*d),
                    world.light_pdf_dir_surface(&unoriented(*from), at),
                ),
                None => (
                    scene.lights.environment(scene.textures(), *d),
                    world.light_pdf_dir_environment(&unoriented(*from), *d),
                ),
            };
            *throughput * radiance * power_heuristic(*pdf_dir, pdf_light)
        }
    };
    if value.is_finite() { value } else { Rgb::ZERO }
}

/// A glossy vertex for the choice of a light: the ray that goes on remembers its place alone.
fn unoriented(p: Vec3) -> LitPoint {
    LitPoint { p, n: None, matte: false }
}

/// Radiance that the rest of the material at a glossy vertex scatters from the lamps, by one weighted light sample.
fn scattered(world: &World, at: &SurfacePoint, wo: Vec3, rng: &mut Sampler, counts: &mut RayCounts) -> Rgb {
    let [ux, uy, u_light, _] = rng.next_4d();
    let (diffuse, rest) = world.bsdf(at, wo).split();
    let Some(rest) = rest else { return Rgb::ZERO };
    let drawn = world.sample_light(&unoriented(at.p), u_light, Vec2::new(ux, uy));
    let Some(LightSample { wi, distance, weight, pdf_dir, .. }) = drawn else { return Rgb::ZERO };
    let (f, pdf_rest) = rest.eval_pdf(wo, wi, Transport::Radiance);
    let value = f * weight;
    if value == Rgb::ZERO {
        return Rgb::ZERO;
    }
    // The ray goes on from here with this probability only.
    let (d_share, r_share) = (diffuse.map_or(0.0, |b| luminance(b.albedo(wo))), luminance(rest.albedo(wo)));
    let follows = r_share / (d_share + r_share);
    let mis = if pdf_dir == 0.0 { 1.0 } else { power_heuristic(pdf_dir, pdf_rest * follows) };
    counts.shadow_rays += 1;
    value * (mis * world.transmittance(world.shadow_ray(at, wi, distance), false).share)
}
