//! Adaptive light sampling: what the edge detector knows of a lamp's visibility decides how it is sampled.
//!
//! For each lamp and point, in the order of Namae and Makino's tests (shade, shadow, highlight):
//! 1. *shade*: nothing is done for a lamp that turns its dark side, or lies below the plane that is lit;
//! 2. lamps that give little ([`DIM`] of the whole), are tiny ([`TINY`]) or, drawn from many, [`SMALL`] get a single sample, points one
//!    shadow ray:
//!    a verdict would cost more than it can save;
//! 3. *shadow*: the verdict of [`EdgeDetector::light`](crate::edge::EdgeDetector::light): blocked -> 0; visible, but for the
//!    receiver's own horizon -> no shadow rays, the closed form for Lambert, else a few stratified samples; partial or
//!    unknown -> m stratified samples with shadow rays;
//! 4. *highlight*: on a lamp that is visible, glossy lobes get m samples where they differ between the lamp's corners and
//!    centre, else a few.
//!
//! Unbiased    with `residual`: prediction plus roulette of the rest (METHODS.md 1.B, 3.B), X = q + B/u d, where q is what the
//!             verdict says and d = f L / pdf (V - V_predicted) of one sample; d = 0 where the verdict is right, so that it
//!             costs a shadow ray at one point in 1/u and no noise. Nothing that is averaged decides how many samples are
//!             taken: decisions rest on verdicts, on fixed points of the lamp and on closed forms
//! Source      Namae and Makino (METHODS.md 3.A); closed form instead of their centre sample
//! Bias        without `residual`: occluders closer to the lamp than 1e-4 of the distance, and any wrong verdict
//! Not handled textured lamps, cylinders and lamps with interpolated normals: no verdict, so sampled

use super::{Chosen, Direct, DirectCounts, MOST_LIGHTS, Point, Unit};
use crate::edge::light::Receiver;
use crate::edge::{Events, Kinds, LightVerdict, NOTHING};
use crate::math::sampler::Block;
use crate::math::{Rgb, Sampler, Vec2, Vec3, luminance};
use crate::scene::light::EmitterView;
use arrayvec::ArrayVec;
use std::f32::consts::FRAC_1_PI;

/// Samples of what is smooth.
pub(super) const FEW: u32 = 4;
/// Share of the light at a point below which a lamp counts as dim.
const DIM: f32 = 0.02;
/// Solid angle below which a lamp counts as tiny.
const TINY: f32 = 1e-5;
/// The same for lamps that were drawn from many: there the choice makes the noise, and a verdict on so small a lamp hardly says
/// more than a shadow ray.
const SMALL: f32 = 1e-2;
/// Probability with which a verdict is checked.
const CHECKED: f32 = 1.0 / 16.0;
/// Spread of a highlight over a lamp, relative to its mean, above which it is sampled in full.
const HIGHLIGHT_SPREAD: f32 = 0.5;

/// A lamp at a point.
struct Lit<'a> {
    chosen: Chosen,
    emitter: u32,
    view: EmitterView<'a>,
    block: Block,
    /// What the diffuse part reflects if the lamp is visible, if there is a closed form.
    closed: Option<Rgb>,
    /// Rough luminance of its contribution.
    estimate: f32,
}

/// What is known of a lamp's visibility.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Known {
    Visible,
    Blocked,
    No,
}

impl Direct<'_> {
    /// All chosen lights at a point.
    pub(super) fn adaptive(&self, point: &Point, rng: &mut Sampler, counts: &mut DirectCounts) -> Rgb {
        let scene = self.world.scene;
        let chosen = self.choose(point, rng);
        let (m, few) = (self.settings.samples, self.settings.samples.min(FEW));
        let lambert = point.diffuse.and_then(|d| d.lambert(point.wo));
        let mut lamps: ArrayVec<Lit, MOST_LIGHTS> = ArrayVec::new();
        let mut sum = Rgb::ZERO;
        for chosen in chosen {
            let Unit::Emitter(emitter) = chosen.unit else {
                sum += self.sampled(point, chosen, few, rng, counts) * chosen.factor;
                continue;
            };
            let block = rng.next_block(m);
            let Some(view) = scene.lights.view(&scene.shapes, scene.textures(), emitter, point.at.p) else { continue };
            if view.is_delta() {
                let nominal = self.nominal_of(point, &chosen);
                sum += self.sampled_view(point, &view, nominal, 1, |_| Vec2::ZERO, counts) * chosen.factor;
                continue;
            }
            let closed = match lambert {
                Some((n, albedo)) => view.irradiance(n).map(|e| e * albedo * FRAC_1_PI),
                None if point.diffuse.is_none() => Some(Rgb::ZERO),
                None => None,
            };
            let estimate = self.estimate(point, &view, closed);
            // Exactly 0: below the plane that is lit.
            if closed == Some(Rgb::ZERO) && estimate == 0.0 && point.rest.is_none() {
                continue;
            }
            let estimate = estimate * chosen.factor;
            lamps.push(Lit { chosen, emitter, view, block, closed, estimate });
        }
        let total: f32 = lamps.iter().map(|l| l.estimate).sum();
        let checks =
            if self.settings.residual && !lamps.is_empty() { Some(rng.next_block(MOST_LIGHTS as u32)) } else { None };
        let mut oversampled = false;
        for (k, lamp) in lamps.iter().enumerate() {
            let check = checks.map(|b| b.point(k as u32));
            sum += self.lamp(point, lamp, total, check, &mut oversampled, counts) * lamp.chosen.factor;
        }
        counts.oversampled += u64::from(oversampled);
        sum
    }

    /// Luminance that a lamp adds if it is visible, from its closed form or its middle.
    fn estimate(&self, point: &Point, view: &EmitterView, closed: Option<Rgb>) -> f32 {
        let middle = || {
            let s = view.sample(Vec2::splat(0.5))?;
            Some(luminance(point.reflected(&s, 1.0)))
        };
        match (closed, point.rest) {
            (Some(c), None) => luminance(c),
            (Some(c), Some(_)) => luminance(c) + middle().unwrap_or(0.0),
            (None, _) => middle().unwrap_or(0.0),
        }
    }

    fn lamp(
        &self,
        point: &Point,
        lamp: &Lit,
        total: f32,
        check: Option<[f32; 4]>,
        oversampled: &mut bool,
        counts: &mut DirectCounts,
    ) -> Rgb {
        let (m, few) = (self.settings.samples, self.settings.samples.min(FEW));
        let nominal = self.nominal_of(point, &lamp.chosen);
        let sampled = |n: u32, counts: &mut DirectCounts| {
            self.sampled_view(point, &lamp.view, nominal, n, |k| lamp.block.point_2d(k), counts)
        };
        let tiny = if self.takes_all(point.vantage.stage) { TINY } else { SMALL };
        if lamp.estimate < DIM * total || lamp.view.solid_angle() < tiny {
            return sampled(1, counts);
        }
        let known = if self.settings.verdicts { self.verdict(point, lamp.emitter, counts) } else { Known::No };
        let predicted = match known {
            Known::No => {
                *oversampled = true;
                return sampled(m, counts);
            }
            Known::Blocked => Rgb::ZERO,
            Known::Visible => {
                let mut value = lamp.closed.unwrap_or(Rgb::ZERO);
                let spread = point.rest.is_some() && self.highlight_varies(point, &lamp.view, nominal, value);
                *oversampled |= spread;
                if point.rest.is_some() || lamp.closed.is_none() {
                    value += self.unshadowed(point, lamp, nominal, if spread { m } else { few }, counts);
                }
                value
            }
        };
        match check {
            Some([x, y, u, _]) if u < CHECKED => {
                predicted + self.residual(point, lamp, nominal, known, Vec2::new(x, y), counts) / CHECKED
            }
            _ => predicted,
        }
    }

    /// What is not in closed form of a lamp that is visible, by samples without shadow rays.
    fn unshadowed(&self, point: &Point, lamp: &Lit, nominal: f32, n: u32, counts: &mut DirectCounts) -> Rgb {
        counts.light_samples += u64::from(n);
        let one = |k: u32| {
            let s = lamp.view.sample(lamp.block.point_2d(k))?;
            Some(match lamp.closed {
                Some(_) => point.rest_reflected(&s, nominal) * s.weight,
                None => point.reflected(&s, nominal),
            })
        };
        (0..n).filter_map(one).sum::<Rgb>() / n as f32
    }

    /// What one sample differs from the prediction by.
    fn residual(
        &self,
        point: &Point,
        lamp: &Lit,
        nominal: f32,
        known: Known,
        u: Vec2,
        counts: &mut DirectCounts,
    ) -> Rgb {
        let Some(s) = lamp.view.sample(u) else { return Rgb::ZERO };
        let value = point.reflected(&s, nominal);
        if value == Rgb::ZERO {
            return Rgb::ZERO;
        }
        let predicted = if known == Known::Visible { 1.0 } else { 0.0 };
        value * (self.visibility(point, &s, counts) - predicted)
    }

    /// Whether the rest of the material differs much between the corners and the centre of a lamp, in terms of what is
    /// reflected in all. Fixed points: what is averaged must not decide.
    fn highlight_varies(&self, point: &Point, view: &EmitterView, nominal: f32, diffuse: Rgb) -> bool {
        const AT: [[f32; 2]; 5] = [[0.02, 0.02], [0.98, 0.02], [0.5, 0.5], [0.02, 0.98], [0.98, 0.98]];
        let value = |u: [f32; 2]| {
            let s = view.sample(Vec2::from(u));
            s.map_or(0.0, |s| luminance(point.rest_reflected(&s, nominal) * s.weight))
        };
        let values = AT.map(value);
        let mean = values.iter().sum::<f32>() / AT.len() as f32;
        let (low, high) = values.iter().fold((f32::INFINITY, 0.0f32), |(l, h), &v| (l.min(v), h.max(v)));
        high - low > HIGHLIGHT_SPREAD * (mean + luminance(diffuse))
    }

    /// The detector's answer for one emitter, which is a shape, or a triangle of a mesh, or two.
    fn look(&self, emitter: u32, from: &Receiver, all: bool) -> LightVerdict {
        let (lights, detector) = (&self.world.scene.lights, &self.detector);
        if let Some(Some(lamp)) = self.lamps.get(emitter as usize) {
            return detector.seen_from(lamp, from, all);
        }
        let prims = lights.emitter_surface(emitter).into_iter().flat_map(|(shape, [a, b])| {
            let second = (b != a).then_some((shape, b));
            std::iter::once((shape, a)).chain(second)
        });
        let verdicts = prims.map(|(shape, prim)| detector.light_prim(shape, prim, from, all));
        verdicts.reduce(both).unwrap_or(LightVerdict::Unknown(NOTHING))
    }

    fn verdict(&self, point: &Point, emitter: u32, counts: &mut DirectCounts) -> Known {
        let receiver = point.receiver();
        let mut verdict = self.look(emitter, &receiver, false);
        // The closed form and the material know the horizon; is there anything else?
        let only_horizon = |v: &LightVerdict| matches!(v, LightVerdict::Partial(e) if e.kinds == Kinds::HORIZON);
        if only_horizon(&verdict) {
            verdict = self.look(emitter, &receiver, true);
        }
        match verdict {
            LightVerdict::Blocked => {
                counts.blocked += 1;
                Known::Blocked
            }
            LightVerdict::Visible => {
                counts.visible += 1;
                Known::Visible
            }
            LightVerdict::Partial(_) if only_horizon(&verdict) => {
                counts.visible += 1;
                Known::Visible
            }
            LightVerdict::Partial(_) => {
                counts.partial += 1;
                Known::No
            }
            LightVerdict::Unknown(_) => {
                counts.unknown += 1;
                Known::No
            }
        }
    }
}

/// Of the two halves of an emitter.
fn both(a: LightVerdict, b: LightVerdict) -> LightVerdict {
    match (a, b) {
        (LightVerdict::Visible, LightVerdict::Visible) | (LightVerdict::Blocked, LightVerdict::Blocked) => a,
        (LightVerdict::Unknown(e), _) | (_, LightVerdict::Unknown(e)) => LightVerdict::Unknown(e),
        _ => {
            // A half that is hidden may be so by anything: then it is not the horizon alone.
            let hidden = a == LightVerdict::Blocked || b == LightVerdict::Blocked;
            let more = if hidden { Kinds::EMITTER } else { Kinds::NONE };
            LightVerdict::Partial(Events { kinds: a.kinds() | b.kinds() | more, ..NOTHING })
        }
    }
}

impl Point<'_> {
    /// The point as the detector sees it. Its horizon counts where nothing from below it is reflected; otherwise shadow rays
    /// leave to either side, and the surface itself blocks only with its other facets.
    fn receiver(&self) -> Receiver {
        let r = Receiver::new(self.at, self.wo);
        let flat = |n: Vec3| r.n.is_some_and(|g| (g.as_vec3() - n).length_squared() < 1e-10);
        Receiver { n: if self.vantage.lit.n.is_some_and(flat) { r.n } else { None }, ..r }
    }
}
