//! One emitter at a time: in view of a point, its samples, its closed-form irradiance, and bounds on where it shines.
//!
//! Irradiance of an emitter of constant radiance L that nothing hides, on a plane with unit normal n:
//! - polygons: Lambert's formula, clipped at the horizon ([`polygon::irradiance`](crate::math::polygon::irradiance));
//! - spheres seen from outside and wholly above the horizon: E = pi L sin^2(alpha) cos(theta);
//! - circular disks wholly above the horizon: E = n . F with F in the plane of the disk's axis and the point; its two
//!   components are the form factors of elements parallel and perpendicular to the disk (Howell's catalogue, B-12, B-13).
//!
//! Bias: none. Not handled (`None`): cylinders, ellipses, textures, interpolated normals, spheres and disks that cross the
//! horizon. Verified by `tests/emitter.rs` against sampling.

use super::area::{self, Lamp, LampPoint, Seen, relative};
use super::delta::{Arrival, DeltaLight};
use super::{Emitter, LightSample, Lights, NONE, Source, mean_channel};
use crate::math::{DVec3, Rgb, Vec2, Vec3};
use crate::math::{polygon, prefetch};
use crate::scene::shape::{Disk, Geometry, Shape, ShapeHit};
use crate::scene::surface::SurfacePoint;
use crate::scene::texture::{Color, Textures};
use arrayvec::ArrayVec;
use std::f32::consts::FRAC_1_PI;
use std::f64::consts::PI;

/// An emitter in view of a point, ready to be sampled. (Lights at infinity that have a density are not among them: see
/// [`Lights::sample_environment`].)
#[derive(Clone, Copy)]
pub struct EmitterView<'a> {
    light: u32,
    p: Vec3,
    kind: Kind<'a>,
}

#[derive(Clone, Copy)]
#[expect(clippy::large_enum_variant, reason = "made where it stays, once per lamp and point")]
enum Kind<'a> {
    Lamp {
        seen: Seen<'a>,
        lamp: Lamp<'a>,
        shape: &'a Shape,
        index: u32,
        prim: u32,
        textures: Textures<'a>,
        /// If it is the same everywhere.
        radiance: Option<Rgb>,
    },
    Delta(Arrival),
}

impl EmitterView<'_> {
    /// Draws a direction towards the emitter; the density is the emitter's own, without a selection probability.
    pub fn sample(&self, u: Vec2) -> Option<LightSample> {
        match &self.kind {
            Kind::Delta(a) => {
                Some(LightSample { wi: a.wi, distance: a.distance, weight: a.value, pdf_dir: 0.0, light: self.light })
            }
            Kind::Lamp { seen, .. } => {
                let q = seen.sample(u)?;
                let radiance = self.radiance(&q);
                (radiance != Rgb::ZERO).then(|| LightSample {
                    wi: q.wi,
                    distance: q.distance,
                    weight: radiance / q.pdf_dir,
                    pdf_dir: q.pdf_dir,
                    light: self.light,
                })
            }
        }
    }

    /// Radiance that arrives from the sampled point of a lamp, 0 from its dark side.
    fn radiance(&self, q: &LampPoint) -> Rgb {
        let Kind::Lamp { shape, index, prim, textures, radiance, .. } = &self.kind else { return Rgb::ZERO };
        match (radiance, &shape.emission) {
            // The side has been decided by geometry, and nothing varies over the surface.
            (Some(c), _) => *c,
            (None, Some(color)) => {
                let hit = ShapeHit { t: q.distance, u: q.barycentric.x, v: q.barycentric.y };
                let at = shape.surface_point(*index, *prim, self.p, q.wi, hit);
                if at.n_shade.dot(q.wi) < 0.0 { textures.color(color, at.uv) } else { Rgb::ZERO }
            }
            (None, None) => Rgb::ZERO,
        }
    }

    /// Whether it is a light without extent: every sample of it is the same.
    pub fn is_delta(&self) -> bool {
        matches!(self.kind, Kind::Delta(_))
    }

    /// Solid angle in which it is seen; of lamps that are sampled by area an estimate, infinite inside of a sphere.
    pub fn solid_angle(&self) -> f32 {
        match &self.kind {
            Kind::Delta(_) => 0.0,
            Kind::Lamp { seen, .. } => seen.solid_angle_estimate() as f32,
        }
    }

    /// Radiance, if it is the same from everywhere.
    pub fn constant_radiance(&self) -> Option<Rgb> {
        match &self.kind {
            Kind::Lamp { radiance, .. } => *radiance,
            Kind::Delta(_) => None,
        }
    }

    /// Corners of a polygonal emitter, relative to the point; none for others.
    pub fn corners(&self) -> ArrayVec<DVec3, 4> {
        let Kind::Lamp { shape, prim, lamp, .. } = &self.kind else { return ArrayVec::new() };
        let parallelogram = |r: &crate::scene::shape::Rectangle| {
            let (c, x, y) = (relative(r.center, self.p), r.ex.as_dvec3(), r.ey.as_dvec3());
            ArrayVec::from([c - x - y, c + x - y, c + x + y, c - x + y])
        };
        match (lamp, &shape.geometry) {
            (Lamp::Parallelogram(patch), _) => parallelogram(&patch.rectangle),
            (_, Geometry::Rectangle(r)) => parallelogram(r),
            (_, Geometry::Mesh(m)) => m.corners(*prim).into_iter().map(|c| relative(c, self.p)).collect(),
            _ => ArrayVec::new(),
        }
    }

    /// Irradiance on a plane with the unit normal `n` (on the lit side) if nothing is in between; `None` where there is no
    /// closed form.
    pub fn irradiance(&self, n: Vec3) -> Option<Rgb> {
        let n = n.as_dvec3();
        let (shape, seen, radiance) = match &self.kind {
            Kind::Delta(a) => return Some(a.value * a.wi.dot(n.as_vec3()).max(0.0)),
            Kind::Lamp { shape, seen, radiance: Some(radiance), .. } => (shape, seen, *radiance),
            Kind::Lamp { .. } => return None,
        };
        let form = match (seen, &shape.geometry) {
            (Seen::Cone { sphere, center, distance, .. }, _) => {
                let (radius, height) = (f64::from(sphere.radius), center.dot(n));
                (height >= radius).then(|| PI * (radius / distance).powi(2) * height / distance)
            }
            (_, Geometry::Disk(d)) => disk_irradiance(d, relative(d.center, self.p), n),
            _ => {
                let corners = self.corners();
                (!corners.is_empty()).then(|| polygon::irradiance(&corners, n))
            }
        };
        form.map(|form| radiance * form as f32)
    }
}

/// Irradiance from a circular disk of radiance 1 at `c` relative to the point, which is on its bright side.
fn disk_irradiance(d: &Disk, c: DVec3, n: DVec3) -> Option<f64> {
    let (x, y, axis) = (d.ex.as_dvec3(), d.ey.as_dvec3(), d.n.as_dvec3());
    let radius = x.length();
    let round = (y.length() - radius).abs() <= 1e-5 * radius && x.dot(y).abs() <= 1e-5 * radius * radius;
    // Half the disk's extent along n.
    let extent = radius * (1.0 - n.dot(axis).powi(2)).max(0.0).sqrt();
    if !round || c.dot(n) < extent {
        return None;
    }
    // Towards the disk: up along its axis, and across.
    let height = -c.dot(axis);
    let across = c + axis * height;
    let side = across.length();
    let (h2, s2, r2) = (height * height, side * side, radius * radius);
    let z = h2 + s2 + r2;
    let root = (z * z - 4.0 * s2 * r2).sqrt();
    // (z - root) without cancellation.
    let rest = 4.0 * s2 * r2 / (z + root);
    let parallel = 0.5 * (1.0 - (z - 2.0 * r2) / root);
    let perpendicular = if side > 0.0 { 0.5 * height / side * rest / root } else { 0.0 };
    let towards = if side > 0.0 { across / side } else { DVec3::ZERO };
    Some(PI * (parallel * -axis.dot(n) + perpendicular * towards.dot(n)))
}

/// Where an emitter is and which way it shines, as a light tree needs it.
#[derive(Clone, Copy, Debug)]
pub struct EmitterBounds {
    /// Box (min, max).
    pub bounds: (Vec3, Vec3),
    /// Axis of the cone of its normals, unit.
    pub axis: Vec3,
    /// Cosine of that cone's half angle.
    pub cos_normals: f32,
    /// Cosine of the angle from a normal up to which it emits: 0 for lamps.
    pub cos_emission: f32,
    /// Largest radiant intensity over all directions, W/sr, mean of the channels: the irradiance at distance 1.
    pub intensity: f32,
    /// Share of it that goes in all directions alike as far as it emits; the rest falls with the cosine.
    pub even: f32,
}

/// Where an emitter is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LightPlace {
    /// Around this point.
    At(Vec3),
    /// At infinity: the unit direction in which its light travels.
    Parallel(Vec3),
    /// At infinity, in all directions.
    Everywhere,
}

impl Lights {
    /// Number of emitters: triangles of lamps (or pairs of them), other lamps, lights without extent, lights at infinity.
    pub fn emitter_count(&self) -> usize {
        self.emitters.len()
    }

    /// Hints that the emitter will be viewed soon.
    #[inline]
    pub fn prefetch(&self, emitter: u32) {
        if let Source::Surface { patch, .. } = self.emitters[emitter as usize].source
            && let Some(patch) = self.patches.get(patch as usize)
        {
            prefetch(patch);
        }
    }

    /// The emitter in view of the point `p`. `None` if it sends nothing there, or is at infinity with a density.
    pub fn view<'a>(
        &'a self,
        shapes: &'a [Shape],
        textures: Textures<'a>,
        emitter: u32,
        p: Vec3,
    ) -> Option<EmitterView<'a>> {
        let Emitter { light, source } = self.emitters[emitter as usize];
        let kind = match source {
            Source::Surface { shape: index, prim, patch, .. } => {
                let shape = &shapes[index as usize];
                let lamp = self.lamp(shapes, index, prim, patch);
                let smooth = matches!(&shape.geometry, Geometry::Mesh(m) if !m.normals.is_empty());
                let radiance = match &shape.emission {
                    Some(Color::Constant(c)) if !smooth => Some(*c),
                    _ => None,
                };
                let seen = Seen::new(lamp, p)?;
                Kind::Lamp { seen, lamp, shape, index, prim, textures, radiance }
            }
            Source::Delta(k) => Kind::Delta(self.deltas[k as usize].arrival(textures, p)?),
            Source::Environment(_) => return None,
        };
        Some(EmitterView { light, p, kind })
    }

    /// The emitter of a surface point, if it is on a lamp.
    pub fn emitter_at(&self, at: &SurfacePoint) -> Option<u32> {
        let start = self.lamps[at.shape as usize];
        (start != NONE).then(|| self.emitter_of[(start + at.prim) as usize])
    }

    /// Shape and primitives of an emitter that is (part of) a lamp; twice the same but for a pair of triangles.
    pub fn emitter_surface(&self, emitter: u32) -> Option<(u32, [u32; 2])> {
        match self.emitters[emitter as usize].source {
            Source::Surface { shape, prim, other, .. } => Some((shape, [prim, other])),
            _ => None,
        }
    }

    /// Density per solid angle with which [`EmitterView::sample`] at `p` draws the point `at` of the emitter.
    pub fn pdf_dir_of(&self, shapes: &[Shape], emitter: u32, p: Vec3, at: &SurfacePoint) -> f32 {
        match self.emitters[emitter as usize].source {
            Source::Surface { shape, prim, patch, .. } => area::pdf_dir(self.lamp(shapes, shape, prim, patch), p, at),
            _ => 0.0,
        }
    }

    /// Where the emitter is and which way it shines; `None` for lights at infinity.
    pub fn emitter_bounds(&self, shapes: &[Shape], emitter: u32) -> Option<EmitterBounds> {
        // Of a plane lamp: area times radiance.
        let intensity = self.powers[emitter as usize] as f32 * FRAC_1_PI;
        let flat = |points: &[Vec3], axis: Vec3| EmitterBounds {
            bounds: points.iter().fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |b, p| (b.0.min(*p), b.1.max(*p))),
            axis,
            cos_normals: 1.0,
            cos_emission: 0.0,
            intensity,
            even: 0.0,
        };
        match self.emitters[emitter as usize].source {
            Source::Surface { shape, prim, patch, .. } => {
                let shape = &shapes[shape as usize];
                // Of a mesh this looks at all of its vertices: not to be asked for each of its triangles.
                let all_round = || {
                    let (lo, hi) = shape.bounds();
                    EmitterBounds { cos_normals: -1.0, even: 1.0, ..flat(&[lo, hi], Vec3::Z) }
                };
                Some(match (self.patches.get(patch as usize), &shape.geometry) {
                    (Some(patch), _) => {
                        let r = &patch.rectangle;
                        let corner = |x: f32, y: f32| r.center + r.ex * x + r.ey * y;
                        flat(&[corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)], r.n)
                    }
                    (None, Geometry::Mesh(m)) => {
                        let n = m.face_normal(prim);
                        let vertex = |i: u32| m.normals.get(i as usize).map_or(1.0, |v| v.dot(n));
                        let cos = m.triangles[prim as usize].map(vertex).into_iter().fold(1.0, f32::min);
                        EmitterBounds { cos_normals: cos.max(-1.0), ..flat(&m.corners(prim), n) }
                    }
                    (None, Geometry::Disk(d)) => {
                        EmitterBounds { axis: d.n, cos_normals: 1.0, even: 0.0, ..all_round() }
                    }
                    // Seen from any side: a quarter of the surface, and the section along the axis.
                    (None, Geometry::Sphere(_)) => EmitterBounds { intensity: 0.25 * intensity, ..all_round() },
                    (None, _) => EmitterBounds { intensity: intensity * FRAC_1_PI, ..all_round() },
                })
            }
            Source::Delta(k) => match &self.deltas[k as usize] {
                DeltaLight::Point { position, intensity } => {
                    let intensity = mean_channel(*intensity) as f32;
                    Some(EmitterBounds { cos_normals: -1.0, intensity, even: 1.0, ..flat(&[*position], Vec3::Z) })
                }
                DeltaLight::Spot { position, to_local, cutoff, intensity, .. } => {
                    let axis = to_local.transpose() * Vec3::Z;
                    let intensity = mean_channel(*intensity) as f32;
                    let (cos_emission, even) = (cutoff.cos(), 1.0 - cutoff.cos().max(0.0));
                    // As bright at the border as in the middle, or nearly so: narrow ones have no room for a difference.
                    Some(EmitterBounds { cos_emission, intensity, even, ..flat(&[*position], axis) })
                }
                DeltaLight::Directional { .. } => None,
            },
            Source::Environment(_) => None,
        }
    }

    /// Mean channel of the irradiance that a parallel light sends through a plane across it.
    pub fn parallel(&self, emitter: u32) -> Option<(Vec3, f32)> {
        match self.emitters[emitter as usize].source {
            Source::Delta(k) => match &self.deltas[k as usize] {
                DeltaLight::Directional { direction, irradiance } => {
                    Some((-*direction, mean_channel(*irradiance) as f32))
                }
                _ => None,
            },
            _ => None,
        }
    }

    /// Whether the emitter is a point light.
    pub fn is_point(&self, emitter: u32) -> bool {
        match self.emitters[emitter as usize].source {
            Source::Delta(k) => matches!(self.deltas[k as usize], DeltaLight::Point { .. }),
            _ => false,
        }
    }

    /// Where the emitter is, roughly: lamps by the middle of their bounds.
    pub fn place(&self, shapes: &[Shape], emitter: u32) -> LightPlace {
        match (self.emitter_bounds(shapes, emitter), self.parallel(emitter)) {
            (Some(b), _) => LightPlace::At(0.5 * (b.bounds.0 + b.bounds.1)),
            (None, Some((towards, _))) => LightPlace::Parallel(-towards),
            (None, None) => LightPlace::Everywhere,
        }
    }

    /// Whether any light at infinity has a density.
    pub fn has_environment(&self) -> bool {
        !self.environments.is_empty()
    }

    /// Mean channel of the radiance of all lights at infinity, averaged over directions.
    pub fn mean_environment(&self) -> f32 {
        // The power is what enters the bounding sphere: pi R^2 times the integral over directions.
        self.environments.iter().map(|(e, _)| mean_channel(e.power(1.0))).sum::<f64>() as f32 / (4.0 * PI * PI) as f32
    }

    /// Draws a direction into the environment, with the density of [`Self::pdf_dir_infinity`].
    pub fn sample_environment(&self, textures: Textures, u_light: f32, u: Vec2) -> Option<LightSample> {
        if let [(only, _)] = self.environments.as_slice() {
            let (wi, radiance, pdf_dir) = only.sample_with_radiance(textures.images, u);
            return self.environment_sample(radiance, wi, pdf_dir);
        }
        let mut rest = u_light * self.environment_pmf();
        let mut chosen = None;
        for (e, emitter) in &self.environments {
            chosen = Some(e);
            rest -= self.table.pmf(*emitter as usize);
            if rest < 0.0 {
                break;
            }
        }
        let wi = chosen?.sample(u);
        self.environment_sample(self.environment(textures, wi), wi, self.pdf_dir_infinity(wi))
    }

    /// Density per solid angle of [`Self::sample_environment`] at the unit direction `w`.
    pub fn pdf_dir_infinity(&self, w: Vec3) -> f32 {
        let pmf = self.environment_pmf();
        if pmf > 0.0 { self.pdf_dir_environment(w) / pmf } else { 0.0 }
    }

    fn environment_pmf(&self) -> f32 {
        self.environments.iter().map(|(_, emitter)| self.table.pmf(*emitter as usize)).sum()
    }

    pub(super) fn environment_sample(&self, radiance: Rgb, wi: Vec3, pdf_dir: f32) -> Option<LightSample> {
        let light = self.environments.first().map_or(0, |(_, emitter)| self.emitters[*emitter as usize].light);
        (pdf_dir > 0.0 && radiance != Rgb::ZERO).then(|| LightSample {
            wi,
            distance: f32::INFINITY,
            weight: radiance / pdf_dir,
            pdf_dir,
            light,
        })
    }
}
