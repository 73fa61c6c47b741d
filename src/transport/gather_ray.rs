//! One gather ray: from a point over specular surfaces to where its radiance comes from irradiance.
//!
//! Estimates   L_ind(x, w) = weight / pi x E(end) + sum of `glossy_direct` over glossy vertices, E = irradiance at the end
//! Meaning     light that an emitter or the environment sends to x directly, or by specular reflection and refraction
//!             alone, counts zero: it belongs to direct light and to the caustic map
//! Chain       a surface is split into its diffuse part and the rest. The ray ends on the diffuse part with the
//!             probability p_d = albedo_d / (albedo_d + albedo_rest) and weight T albedo_d / p_d; else it follows a sample
//!             of the rest with T f cos / (pdf (1 - p_d)). Where the rest is rougher than [`NEARLY_SPECULAR_ALPHA`],
//!             its share of the lamps' light is added by one light
//!             sample, [`glossy_direct`]
//! Measure     light and BSDF densities per solid angle at the surface they belong to
//! Source      Jensen 1996, "Global Illumination using Photon Maps" (the split of light); Yue, Onoue and Nishita
//! Bias        the diffuse part answers with its albedo towards the ray, whatever the direction its light comes from (exact
//!             for Lambert; a coat's transmittance for the incident direction is taken at its mean). Chains longer than
//!             [`MAX_CHAIN`] end
//! Verified by tests/irradiance_cache.rs: closed furnaces with Lambert, mirror and mixed walls

use super::cache_file::stored;
use super::{NEARLY_SPECULAR_ALPHA, World};
use crate::accel::Ray;
use crate::math::{Rgb, Sampler, Vec2, Vec3, luminance};
use crate::scene::{LightSample, LobeKind, SurfacePoint, Transport};

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

/// A glossy surface on the way, lit by lamps: what a change of the light has to evaluate anew.
#[derive(Clone, Copy, Debug)]
pub struct GlossyVertex {
    /// The surface.
    pub at: SurfacePoint,
    /// Towards where the ray came from, unit.
    pub wo: Vec3,
    /// Throughput up to there.
    pub throughput: Rgb,
}

/// What a gather ray found.
#[derive(Clone, Copy, Debug)]
pub struct GatherEnd {
    /// Length of the whole chain up to the end, infinite for rays that leave the scene.
    pub distance: f32,
    /// Geometric normal at the end towards the ray, where the chain has no corner; else against the first direction.
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

stored!(RayCounts { rays, shadow_rays });
stored!(SurfacePoint { p, p_error, n_geo, n_shade, uv, dp_du, dp_dv, shape, prim });
stored!(GlossyVertex { at, wo, throughput });

impl std::ops::AddAssign for RayCounts {
    fn add_assign(&mut self, o: RayCounts) {
        self.rays += o.rays;
        self.shadow_rays += o.shadow_rays;
    }
}

impl World<'_> {
    /// Follows a gather ray from `o` along the unit vector `d`; `on_glossy` is told of each rough glossy vertex.
    pub fn gather(
        &self,
        o: Vec3,
        d: Vec3,
        rng: &mut Sampler,
        counts: &mut RayCounts,
        mut on_glossy: impl FnMut(GlossyVertex),
    ) -> GatherEnd {
        let mut ray = Ray { o, d, tmin: f32::MIN_POSITIVE, tmax: f32::INFINITY };
        let mut found = GatherEnd { distance: 0.0, normal: -d, end: None };
        let (mut throughput, mut straight) = (Rgb::ONE, true);
        for _ in 0..MAX_CHAIN {
            counts.rays += 1;
            let Some(hit) = self.accel.closest(&ray) else {
                found.distance = f32::INFINITY;
                return found;
            };
            found.distance += hit.t;
            let at = self.surface(&ray, &hit);
            let wo = -ray.d;
            if straight {
                found.normal = if at.n_geo.dot(wo) < 0.0 { -at.n_geo } else { at.n_geo };
            }

            let (diffuse, rest) = self.bsdf(&at, wo).split();
            let albedo = diffuse.map_or(Rgb::ZERO, |b| b.albedo(wo));
            let Some(rest) = rest else {
                found.end = usable(DiffuseEnd { at, wo, weight: throughput * albedo });
                return found;
            };
            if !rest.is_delta() && rest.min_alpha() >= NEARLY_SPECULAR_ALPHA {
                on_glossy(GlossyVertex { at, wo, throughput });
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
            if s.lobe != LobeKind::Null && straight {
                straight = false;
                found.normal = -d;
            }
            ray = Ray { o: at.spawn_origin(s.wi), d: s.wi, tmin: f32::MIN_POSITIVE, tmax: f32::INFINITY };
        }
        found
    }
}

fn usable(end: DiffuseEnd) -> Option<DiffuseEnd> {
    (end.weight.is_finite() && end.weight.max_element() > 0.0).then_some(end)
}

/// Throughput times the radiance that the rest of the material at a vertex scatters from the lamps: one light sample.
pub fn glossy_direct(world: &World, vertex: &GlossyVertex, rng: &mut Sampler, counts: &mut RayCounts) -> Rgb {
    let scene = world.scene;
    let [ux, uy, u_light, _] = rng.next_4d();
    let (GlossyVertex { at, wo, throughput }, (_, Some(rest))) = (vertex, world.bsdf(&vertex.at, vertex.wo).split())
    else {
        return Rgb::ZERO;
    };
    let Some(LightSample { wi, distance, weight, .. }) =
        scene.lights.sample(&scene.shapes, scene.textures(), at.p, u_light, Vec2::new(ux, uy))
    else {
        return Rgb::ZERO;
    };
    let value = *throughput * rest.eval(*wo, wi, Transport::Radiance) * weight;
    if value == Rgb::ZERO || !value.is_finite() {
        return Rgb::ZERO;
    }
    counts.shadow_rays += 1;
    value * world.transmittance(world.shadow_ray(at, wi, distance), false).share
}
