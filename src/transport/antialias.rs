//! Antialiasing: which pixels need several samples in every pass?
//!
//! For each pixel, over its footprint (the support of the reconstruction filter):
//! - *sight*: the edge detector's verdict on what is seen first, events or unknown;
//! - *chain*: events seen through smooth mirrors and glass, predicted;
//! - *shadow*: edges of hard shadows on what the centre ray sees, of lights without extent and of lamps that are seen under less
//!   than [`SMALL`], taken as points: exact on planes ([`hard_shadow`](crate::edge::hard_shadow));
//! - *texture*: the albedo at nine points of the footprint differs by more than a tenth.
//!
//! A pixel with any of them gets k samples per pass, the others one. The map is a pure function of the scene; samples belong to
//! one pixel and their number is fixed beforehand, so that the picture is unbiased for any filter and whatever the map says.
//! Source: Namae and Makino (METHODS.md 3.A); margins, and shadows by footprints from the light, in place of their predictions.
//! Not handled: shadows and textures seen in mirrors; textures of roughness and normals; depth of field for shadows and textures;
//! hard shadows near the contact on curved surfaces. Verified by `tests`: recall against brute force, determinism.

use super::World;
use crate::accel::Ray;
use crate::edge::hard_shadow::{PointOrDirection, ShadowPatch};
use crate::edge::{EdgeDetector, Facet, Kinds, LightVerdict};
use crate::math::{DVec3, Rgb, Vec2, Vec3};
use crate::scene::light::LightPlace;
use crate::scene::{Geometry, SurfacePoint};
use rayon::prelude::*;

/// Solid angle below which a lamp's shadows count as hard.
pub const SMALL: f32 = 1e-4;
/// Most lights whose hard shadows are looked for; more are taken as soft in sum.
const MOST_LIGHTS: usize = 8;
/// Difference of albedos within a footprint that counts.
const TEXTURE_STEP: f32 = 0.1;

/// Settings of [`samples_per_pixel`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
pub struct AntialiasSettings {
    /// Samples per pass of pixels with edges.
    pub samples: u16,
    /// The camera does not see lamps.
    pub hide_emitters: bool,
}

impl Default for AntialiasSettings {
    fn default() -> Self {
        AntialiasSettings { samples: 8, hide_emitters: false }
    }
}

/// Why a pixel needs samples, as bits.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Causes(pub u8);

impl Causes {
    /// An edge that is seen.
    pub const SIGHT: Causes = Causes(1);
    /// An edge that is seen in a mirror or through glass.
    pub const CHAIN: Causes = Causes(2);
    /// The edge of a hard shadow.
    pub const SHADOW: Causes = Causes(4);
    /// Detail of a texture.
    pub const TEXTURE: Causes = Causes(8);

    /// Whether any cause is in both.
    pub fn intersects(self, other: Causes) -> bool {
        self.0 & other.0 != 0
    }
}

/// Samples per pass of each pixel of the window (x, y, width, height), row by row.
pub fn samples_per_pixel(world: World, window: [u32; 4], settings: AntialiasSettings) -> Vec<u16> {
    let samples = |c: Causes| if c == Causes::default() { 1 } else { settings.samples.max(1) };
    causes(world, window, settings.hide_emitters).into_iter().map(samples).collect()
}

/// Why each pixel of the window (x, y, width, height) needs samples, row by row.
pub fn causes(world: World, [x0, y0, width, height]: [u32; 4], hide_emitters: bool) -> Vec<Causes> {
    let aliasing = Aliasing::new(world, hide_emitters);
    let row = |y: u32| (x0..x0 + width).map(|x| aliasing.pixel(x, y)).collect::<Vec<_>>();
    (y0..y0 + height).into_par_iter().flat_map_iter(row).collect()
}

struct Aliasing<'a> {
    world: World<'a>,
    detector: EdgeDetector<'a>,
    /// Half size of a footprint, pixels.
    half: f64,
    /// Emitters that may cast hard shadows.
    lights: Vec<u32>,
    textured: bool,
}

impl<'a> Aliasing<'a> {
    fn new(world: World<'a>, hide_emitters: bool) -> Self {
        let lights = &world.scene.lights;
        let hard = |e: &u32| !matches!(lights.place(&world.scene.shapes, *e), LightPlace::Everywhere);
        let list: Vec<u32> = (0..lights.emitter_count() as u32).filter(hard).take(MOST_LIGHTS + 1).collect();
        Aliasing {
            world,
            detector: EdgeDetector::new(world.scene, world.accel).hiding_lamps(hide_emitters),
            half: f64::from(world.scene.film.filter.radius()),
            lights: if list.len() > MOST_LIGHTS { Vec::new() } else { list },
            textured: !world.scene.textures.is_empty(),
        }
    }

    fn pixel(&self, x: u32, y: u32) -> Causes {
        let centre = [f64::from(x) + 0.5, f64::from(y) + 0.5];
        let half = [self.half; 2];
        let mut causes = 0;
        if self.detector.film_patch(centre, half, false).needs_samples() {
            // One cause is enough.
            return Causes::SIGHT;
        }
        let Some((ray, at)) = self.detector.first_hit(x, y) else { return Causes::default() };
        let bsdf = self.world.bsdf(&at, -ray.d);
        if bsdf.min_alpha() == 0.0 && self.detector.film_patch_chain(centre, half, false).kinds != Kinds::NONE {
            causes |= Causes::CHAIN.0;
        }
        if bsdf.is_delta() || (self.lights.is_empty() && !self.textured) {
            return Causes(causes);
        }
        let Some(edges) = self.on_surface(x, y, &at) else { return Causes(causes) };
        if self.textured && self.texture_varies(&at, -ray.d, edges) {
            causes |= Causes::TEXTURE.0;
        }
        if self.lights.iter().any(|&e| self.shadow_changes(e, &at, -ray.d, edges)) {
            causes |= Causes::SHADOW.0;
        }
        Causes(causes)
    }

    /// Half edges of the footprint on the tangent plane; `None` where it reaches beyond the plane's horizon.
    fn on_surface(&self, x: u32, y: u32, at: &SurfacePoint) -> Option<[DVec3; 2]> {
        let (n, p) = (at.n_geo.as_dvec3(), at.p.as_dvec3());
        let meet = |dx: f32, dy: f32| {
            let r = self.world.scene.camera.ray(Vec2::new(x as f32 + 0.5 + dx, y as f32 + 0.5 + dy), Vec2::splat(0.5));
            let ray = Ray { o: r.o, d: r.d, tmin: r.tmin, tmax: r.tmax };
            let (o, d) = (ray.o.as_dvec3(), ray.d.as_dvec3());
            let t = (p - o).dot(n) / d.dot(n);
            (t > 0.0 && t.is_finite()).then(|| o + d * t)
        };
        let h = self.half as f32;
        Some([0.5 * (meet(h, 0.0)? - meet(-h, 0.0)?), 0.5 * (meet(0.0, h)? - meet(0.0, -h)?)])
    }

    fn texture_varies(&self, at: &SurfacePoint, wo: Vec3, edges: [DVec3; 2]) -> bool {
        let [ex, ey] = edges.map(|e| uv_of(at, e.as_vec3()));
        let (mut low, mut high) = (Rgb::INFINITY, Rgb::NEG_INFINITY);
        for (a, b) in [
            (0.0, 0.0),
            (-1.0, -1.0),
            (1.0, -1.0),
            (-1.0, 1.0),
            (1.0, 1.0),
            (-0.4, 0.3),
            (0.3, 0.4),
            (0.4, -0.3),
            (-0.3, -0.4),
        ] {
            let at = SurfacePoint { uv: at.uv + ex * a + ey * b, ..*at };
            let albedo = self.world.bsdf(&at, wo).albedo(wo);
            (low, high) = (low.min(albedo), high.max(albedo));
        }
        (high - low).max_element() > TEXTURE_STEP
    }

    fn shadow_changes(&self, emitter: u32, at: &SurfacePoint, wo: Vec3, edges: [DVec3; 2]) -> bool {
        let World { scene, .. } = self.world;
        let Some(view) = scene.lights.view(&scene.shapes, scene.textures(), emitter, at.p) else { return false };
        if view.solid_angle() >= SMALL {
            return false;
        }
        let n = if at.n_geo.dot(wo) < 0.0 { -at.n_geo } else { at.n_geo };
        let (light, towards) = match scene.lights.place(&scene.shapes, emitter) {
            LightPlace::At(q) => (PointOrDirection::Point(q.as_dvec3()), q - at.p),
            LightPlace::Parallel(d) => (PointOrDirection::Parallel(d.as_dvec3()), -d),
            LightPlace::Everywhere => return false,
        };
        if n.dot(towards) <= 0.0 {
            return false;
        }
        let shape = &scene.shapes[at.shape as usize];
        let flat = match &shape.geometry {
            Geometry::Rectangle(_) | Geometry::Disk(_) => true,
            Geometry::Mesh(m) => m.normals.is_empty(),
            _ => false,
        };
        let size = edges[0].length() + edges[1].length();
        let reach = (at.p - scene.bounds.0).length() + scene.bounds.1;
        let margin = if flat { 1e-6 * f64::from(reach) } else { size };
        let facet = Facet { shape: at.shape, prim: at.prim };
        let patch = ShadowPatch { p: at.p.as_dvec3(), half: edges, facet, margin };
        let lamp = scene.lights.emitter_surface(emitter).map(|(shape, [prim, _])| Facet { shape, prim });
        matches!(self.detector.hard_shadow(light, &patch, lamp), LightVerdict::Partial(_) | LightVerdict::Unknown(_))
    }
}

/// Texture coordinates of a tangent vector: the least-squares solution of dp_du a + dp_dv b = e.
fn uv_of(at: &SurfacePoint, e: Vec3) -> Vec2 {
    let (u, v) = (at.dp_du, at.dp_dv);
    let (uu, uv, vv) = (u.dot(u), u.dot(v), v.dot(v));
    let det = uu * vv - uv * uv;
    let (a, b) = (u.dot(e), v.dot(e));
    let solution = Vec2::new(a * vv - b * uv, b * uu - a * uv) / det;
    if solution.is_finite() { solution } else { Vec2::ZERO }
}

#[cfg(test)]
#[path = "antialias_tests.rs"]
mod tests;
