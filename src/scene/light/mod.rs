//! Lights: direct sampling towards a point with its densities, and what a ray that arrives sees.
//!
//! Estimates   direct light at a point p by one sample of radiance / (pmf x pdf_dir); `weight` is that quotient
//! Measure     `pdf_dir` is per solid angle at p and includes the probability of the selection; delta lights (points,
//!             spots, parallel light) have no density: 0
//! Selection   one alias table (Walker 1974) over all *emitters*: every triangle of an emissive mesh (or two that make up a
//!             parallelogram), every other lamp, every delta light, every environment light is an entry, in proportion to the mean channel of its power
//!             (lights at infinity: what enters the scene's bounding sphere), O(1) for any number of lamps. Each entry gets at
//!             least 1/1000 of an even share, so that whatever is close can be found
//! Environment several lights at infinity are one: a direction is drawn from one of them, density and radiance are those
//!             of their sum
//! Bias        none. Emission is one-sided: the side is that of the interpolated normal, as in Mitsuba 3
//! Not handled selection by position: that is `transport::light_tree`'s, by way of [`EmitterView`]; power of both sides
//! Verified by `tests.rs`: chi-square against `pdf_dir`, closed-form irradiance, the same density found and sampled

mod area;
mod delta;
mod emitter;
mod environment;
mod pairs;

use super::description::LightDesc;
use super::shape::{Geometry, Shape};
use super::surface::SurfacePoint;
use super::texture::{Bitmap, Color, Texture, Textures};
use crate::math::distribution::AliasTable;
use crate::math::morton::morton;
use crate::math::sampler::refine;
use crate::math::{Rgb, Vec2, Vec3};
use area::Patch;
pub use delta::DeltaLight;
pub use emitter::{EmitterBounds, EmitterView, LightPlace};
pub use environment::{DrawnDirection, EnvMap, Environment};

/// Smallest selection weight of an emitter, as a fraction of the average one.
const FLOOR: f64 = 1e-3;

/// A direction towards a light.
#[derive(Clone, Copy, Debug)]
pub struct LightSample {
    /// Unit direction from the shaded point to the light.
    pub wi: Vec3,
    /// Distance to the sampled point; infinite for lights at infinity. A shadow ray must end just before:
    /// at distance x (1 - 1e-4).
    pub distance: f32,
    /// Radiance that arrives if nothing is in between, over `pdf_dir` and selection probability; for delta lights
    /// intensity / distance^2 or irradiance over the selection probability.
    pub weight: Rgb,
    /// Density per solid angle, selection probability included; 0 for delta lights (points, directions).
    pub pdf_dir: f32,
    /// The light, as an index into [`Lights::infos`].
    pub light: u32,
}

/// A light as `info` lists it.
#[derive(Clone, Debug)]
pub struct LightInfo {
    /// Kind: `area (rectangle)`, `point`, `envmap`, ...
    pub kind: String,
    /// Name of the shape, or empty.
    pub name: String,
    /// Emitted power, W (for lights at infinity: what enters the scene's bounding sphere). Area lamps: pi x area x radiance
    /// (mean of a texture over its picture).
    pub power: Rgb,
    /// Emitting primitives (triangles of a mesh; 1 for others).
    pub primitives: usize,
}

/// All lights of a scene.
#[derive(Clone, Debug)]
pub struct Lights {
    /// One entry per light of the file: area lights in order of their shapes, then the others.
    pub infos: Vec<LightInfo>,
    table: AliasTable,
    /// Power of each emitter, W, mean of the channels.
    powers: Vec<f64>,
    emitters: Vec<Emitter>,
    /// Per shape: where its primitives start in `emitter_of`, or [`NONE`].
    lamps: Vec<u32>,
    /// Emitter of each primitive of each lamp.
    emitter_of: Vec<u32>,
    patches: Vec<Patch>,
    deltas: Vec<DeltaLight>,
    /// Lights at infinity, with their emitters.
    environments: Vec<(Environment, u32)>,
}

const NONE: u32 = u32::MAX;

/// What a light of [`Lights::infos`] is, for those who follow light from there.
#[derive(Clone, Copy, Debug)]
pub enum LightKind<'a> {
    /// A shape, by its index: radiance `Shape::emission`, on the side of the interpolated normal.
    Lamp(u32),
    /// A light without extent.
    Delta(&'a DeltaLight),
    /// A light at infinity.
    Environment(&'a Environment),
}

/// One entry of the selection table; `light` is an index into [`Lights::infos`].
#[derive(Clone, Copy, Debug)]
struct Emitter {
    light: u32,
    source: Source,
}

#[derive(Clone, Copy, Debug)]
enum Source {
    /// A primitive of a lamp, or two; `patch` is an index into `patches` or [`NONE`].
    Surface {
        shape: u32,
        prim: u32,
        /// The second triangle of a pair, else `prim`.
        other: u32,
        patch: u32,
    },
    Delta(u32),
    Environment(u32),
}

impl Lights {
    /// Collects the lights. `bounds` is the scene's bounding sphere (centre, radius).
    pub fn new(
        shapes: &[Shape],
        lights: &[LightDesc],
        textures: &[Texture],
        images: &[Bitmap],
        bounds: (Vec3, f32),
    ) -> Self {
        let textures = Textures { textures, images };
        let mut all = Lights {
            infos: Vec::new(),
            table: AliasTable::default(),
            powers: Vec::new(),
            emitters: Vec::new(),
            lamps: vec![NONE; shapes.len()],
            emitter_of: Vec::new(),
            patches: Vec::new(),
            deltas: Vec::new(),
            environments: Vec::new(),
        };
        let mut weights = Vec::new();
        for (index, shape) in shapes.iter().enumerate() {
            if let Some(color) = &shape.emission {
                all.add_lamp(index as u32, shape, textures.mean(color), &mut weights);
            }
        }
        for desc in lights {
            all.add_light(desc, textures, bounds.1, &mut weights);
        }
        all.sort_patches();
        let sane = |w: f64| if w.is_finite() && w > 0.0 { w } else { 0.0 };
        let floor = FLOOR * weights.iter().map(|&w| sane(w)).sum::<f64>() / weights.len().max(1) as f64;
        let floored: Vec<f64> = weights.iter().map(|&w| sane(w).max(floor)).collect();
        all.table = AliasTable::new(&floored);
        all.powers = weights.into_iter().map(sane).collect();
        all
    }

    fn add_lamp(&mut self, index: u32, shape: &Shape, radiance: Rgb, weights: &mut Vec<f64>) {
        let kind = match &shape.geometry {
            Geometry::Mesh(_) => "mesh",
            Geometry::Sphere(_) => "sphere",
            Geometry::Rectangle(_) => "rectangle",
            Geometry::Disk(_) => "disk",
            Geometry::Cylinder(_) => "cylinder",
        };
        let count = shape.primitive_count();
        let light = self.infos.len() as u32;
        self.lamps[index as usize] = self.emitter_of.len() as u32;
        let parallelograms = pairs::parallelograms(shape);
        let mut area = 0.0;
        for prim in 0..count as u32 {
            let mut a = shape.primitive_area(prim) as f64;
            area += a;
            let pair = parallelograms.get(prim as usize).and_then(Option::as_ref);
            if let Some((other, _)) = pair.filter(|(other, _)| *other < prim) {
                let first = self.emitter_of[(self.lamps[index as usize] + other) as usize];
                self.emitter_of.push(first);
                continue;
            }
            let rectangle = match (&shape.geometry, pair) {
                (_, Some((other, rectangle))) => {
                    a += shape.primitive_area(*other) as f64;
                    Some(rectangle)
                }
                (Geometry::Rectangle(rectangle), _) => Some(rectangle),
                _ => None,
            };
            let patch = rectangle.map_or(NONE, |r| {
                self.patches.push(Patch::new(r.clone()));
                self.patches.len() as u32 - 1
            });
            weights.push(std::f64::consts::PI * a * mean_channel(radiance));
            self.emitter_of.push(self.emitters.len() as u32);
            let other = pair.map_or(prim, |(other, _)| *other);
            self.emitters.push(Emitter { light, source: Source::Surface { shape: index, prim, other, patch } });
        }
        if let (Geometry::Rectangle(_), Some(&emitter)) = (&shape.geometry, self.emitter_of.last()) {
            // Rays meet a rectangle in one of two halves, which they name as its primitives 0 and 1.
            self.emitter_of.push(emitter);
        }
        self.infos.push(LightInfo {
            kind: format!("area ({kind})"),
            name: shape.name.clone(),
            power: radiance * (std::f64::consts::PI * area) as f32,
            primitives: count,
        });
    }

    /// Puts patches that are near each other in space near each other in memory: they are asked for together.
    fn sort_patches(&mut self) {
        let finite = self.patches.iter().map(|p| p.rectangle.center).filter(|c| c.is_finite());
        let (lo, hi) = finite.fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |b, c| (b.0.min(c), b.1.max(c)));
        let scale = 65_535.0 / (hi - lo).max_element().max(f32::MIN_POSITIVE);
        let key = |p: &Patch| morton((p.rectangle.center - lo) * scale);
        let mut order: Vec<(u64, u32)> = self.patches.iter().map(key).zip(0..).collect();
        order.sort_unstable();
        let mut place = vec![0; order.len()];
        (0..).zip(&order).for_each(|(to, &(_, from))| place[from as usize] = to);
        self.patches = order.iter().map(|&(_, from)| self.patches[from as usize].clone()).collect();
        for emitter in &mut self.emitters {
            if let Source::Surface { patch, .. } = &mut emitter.source
                && let Some(&to) = place.get(*patch as usize)
            {
                *patch = to;
            }
        }
    }

    fn add_light(&mut self, desc: &LightDesc, textures: Textures, radius: f32, weights: &mut Vec<f64>) {
        let (kind, power, source) = if let Some(delta) = DeltaLight::new(desc) {
            let summary = (delta.kind(), delta.power(textures, radius));
            self.deltas.push(delta);
            (summary.0, summary.1, Source::Delta(self.deltas.len() as u32 - 1))
        } else if let Some(environment) = Environment::new(desc, textures.images) {
            let summary = (environment.kind(), environment.power(radius));
            self.environments.push((environment, self.emitters.len() as u32));
            (summary.0, summary.1, Source::Environment(self.environments.len() as u32 - 1))
        } else {
            return;
        };
        weights.push(mean_channel(power));
        self.emitters.push(Emitter { light: self.infos.len() as u32, source });
        self.infos.push(LightInfo { kind: kind.into(), name: String::new(), power, primitives: 1 });
    }

    /// What light `light`, an index into [`Self::infos`], is.
    pub fn kind(&self, light: usize) -> LightKind<'_> {
        // Emitters are in order of their lights, of which each has one at least.
        let first = self.emitters.partition_point(|e| (e.light as usize) < light);
        match self.emitters[first].source {
            Source::Surface { shape, .. } => LightKind::Lamp(shape),
            Source::Delta(k) => LightKind::Delta(&self.deltas[k as usize]),
            Source::Environment(k) => LightKind::Environment(&self.environments[k as usize].0),
        }
    }

    /// Whether the power in [`Self::infos`] is an estimate: the mean of a texture or map, which what is lit through it need not see.
    pub fn is_estimated(&self, light: usize, shapes: &[Shape]) -> bool {
        match self.kind(light) {
            LightKind::Lamp(shape) => matches!(shapes[shape as usize].emission, Some(Color::Texture(_))),
            LightKind::Delta(DeltaLight::Spot { texture, .. }) => texture.is_some(),
            LightKind::Delta(_) | LightKind::Environment(Environment::Constant { .. }) => false,
            LightKind::Environment(Environment::Map(_)) => true,
        }
    }

    fn lamp<'a>(&'a self, shapes: &'a [Shape], shape: u32, prim: u32, patch: u32) -> area::Lamp<'a> {
        match self.patches.get(patch as usize) {
            Some(patch) => area::Lamp::Parallelogram(patch),
            None => area::Lamp::Primitive(&shapes[shape as usize], prim),
        }
    }

    /// Whether there is no light at all.
    pub fn is_empty(&self) -> bool {
        self.emitters.is_empty()
    }

    /// Whether every light can be reached by sampling only (points, spots, parallel light): no ray meets one.
    pub fn is_delta_only(&self) -> bool {
        self.emitters.iter().all(|e| matches!(e.source, Source::Delta(_)))
    }

    /// Samples a light towards the point `p`: `u_light` selects it (by power), `u` the direction. `None`: the light chosen
    /// sends nothing to `p`, which counts as a sample of value 0.
    pub fn sample(&self, shapes: &[Shape], textures: Textures, p: Vec3, u_light: f32, u: Vec2) -> Option<LightSample> {
        let index = self.table.sample(refine(u_light, u))?;
        let pmf = self.table.pmf(index);
        if let Source::Environment(k) = self.emitters[index].source {
            let wi = self.environments[k as usize].0.sample(u);
            return self.environment_sample(self.environment(textures, wi), wi, self.pdf_dir_environment(wi));
        }
        let s = self.view(shapes, textures, index as u32, p)?.sample(u)?;
        Some(LightSample { weight: s.weight / pmf, pdf_dir: s.pdf_dir * pmf, ..s })
    }

    /// Radiance that the surface point `at` emits towards the unit vector `w`; zero for what is no lamp.
    pub fn emitted(&self, shapes: &[Shape], textures: Textures, at: &SurfacePoint, w: Vec3) -> Rgb {
        match &shapes[at.shape as usize].emission {
            Some(color) if at.n_shade.dot(w) > 0.0 => textures.color(color, at.uv),
            _ => Rgb::ZERO,
        }
    }

    /// Density per solid angle with which [`Self::sample`] at `p` draws the direction to the lamp point `at`.
    pub fn pdf_dir_surface(&self, shapes: &[Shape], p: Vec3, at: &SurfacePoint) -> f32 {
        let Some(emitter) = self.emitter_at(at) else { return 0.0 };
        self.pdf_dir_of(shapes, emitter, p, at) * self.table.pmf(emitter as usize)
    }

    /// Greatest contrast of an environment (see [`Environment::contrast`]); 0 where there is none.
    pub fn environment_contrast(&self) -> f32 {
        self.environments.iter().map(|(e, _)| e.contrast()).fold(0.0, f32::max)
    }

    /// Radiance from infinity along the unit direction `w` (away from the scene): all environment lights.
    pub fn environment(&self, textures: Textures, w: Vec3) -> Rgb {
        self.environments.iter().map(|(e, _)| e.radiance(textures.images, w)).sum()
    }

    /// Density per solid angle with which [`Self::sample`] draws the direction `w` into the environment.
    pub fn pdf_dir_environment(&self, w: Vec3) -> f32 {
        let one = |(e, emitter): &(Environment, u32)| self.table.pmf(*emitter as usize) * e.pdf_dir(w);
        self.environments.iter().map(one).sum()
    }
}

fn mean_channel(c: Rgb) -> f64 {
    c.as_dvec3().element_sum() / 3.0
}

#[cfg(test)]
mod tests;
