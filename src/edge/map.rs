//! Edge maps: one footprint per pixel.

use super::confirmed::Question;
use super::kinds::{Events, Kinds, LightVerdict, Verdict};
use super::light::Receiver;
use super::pixel::{self, PixelFamily};
use super::predicted::D1;
use super::{EdgeDetector, Facet, NOTHING};
use crate::accel::{Hit, Ray};
use crate::math::Vec2;
use crate::scene::shape::ShapeHit;
use crate::scene::{Scene, SurfacePoint};
use dualux_dual::Family;
use rayon::prelude::*;

/// What is known of one footprint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cell {
    /// Whether it has an event.
    pub event: bool,
    /// Kinds of all events.
    pub kinds: Kinds,
    /// Distance of the nearest, half widths.
    pub distance: f64,
}

/// Shapes that are area lights, in the order of the file.
pub fn area_lights(scene: &Scene) -> Vec<u32> {
    (0u32..).zip(&scene.shapes).filter(|(_, s)| s.emission.is_some()).map(|(i, _)| i).collect()
}

impl EdgeDetector<'_> {
    /// The pixel with upper left corner (x, y).
    pub fn pixel(&self, x: u32, y: u32, all: bool) -> Verdict {
        self.film_patch([f64::from(x) + 0.5, f64::from(y) + 0.5], [0.5; 2], all)
    }

    /// The film's rectangle around `centre` with half sizes `half`, in pixels.
    pub fn film_patch(&self, centre: [f64; 2], half: [f64; 2], all: bool) -> Verdict {
        match pixel::family(&self.scene.camera, centre, half) {
            Some(PixelFamily::Exact(view)) => {
                if all {
                    self.all(&view, None)
                } else {
                    self.any(&view, None)
                }
            }
            Some(PixelFamily::Lens(family, t)) => {
                if !all && self.clear_lens(&family, t) {
                    return Verdict::Clear;
                }
                let question = Question { t, exclude: Facet::NONE, round: true, grow: 1.0, all, swaps: true };
                self.predict_in(&family.ray::<D1<4>>(), question, || self.first(&family, t))
            }
            None => Verdict::Unknown(NOTHING),
        }
    }

    /// Shape and distance, in units of the direction, of what the centre ray of a family meets.
    pub(super) fn first<const N: usize>(&self, family: &Family<f64, N>, t: [f64; 2]) -> Option<(u32, f64)> {
        let [o, d] = [family.o, family.d].map(|v| super::view::from_dual(v).as_vec3());
        let hit = self.closest_seen(&Ray { o, d, tmin: t[0] as f32, tmax: t[1] as f32 })?;
        Some((hit.shape, f64::from(hit.t)))
    }

    /// What a pixel sees by smooth reflection and refraction.
    pub fn pixel_chain(&self, x: u32, y: u32, all: bool) -> Events {
        self.film_patch_chain([f64::from(x) + 0.5, f64::from(y) + 0.5], [0.5; 2], all)
    }

    /// The same for a rectangle of the film.
    pub fn film_patch_chain(&self, centre: [f64; 2], half: [f64; 2], all: bool) -> Events {
        match pixel::family(&self.scene.camera, centre, half) {
            Some(PixelFamily::Exact(view)) => self.chain(&view.family, view.t, all),
            Some(PixelFamily::Lens(family, t)) => self.chain(&family, t, all),
            None => NOTHING,
        }
    }

    /// What the ray through a pixel's centre meets first.
    pub fn first_hit(&self, x: u32, y: u32) -> Option<(Ray, SurfacePoint)> {
        let r = self.scene.camera.ray(Vec2::new(x as f32 + 0.5, y as f32 + 0.5), Vec2::splat(0.5));
        let ray = Ray { o: r.o, d: r.d, tmin: r.tmin, tmax: r.tmax };
        let Hit { t, u, v, shape, prim } = self.closest_seen(&ray)?;
        let at = self.scene.shapes[shape as usize].surface_point(shape, prim, ray.o, ray.d, ShapeHit { t, u, v });
        Some((ray, at))
    }

    /// The map of a window (x, y, width, height) of the film.
    pub fn pixel_map(&self, [x0, y0, w, h]: [u32; 4]) -> Vec<Cell> {
        rows(w, h, |x, y| {
            let verdict = self.pixel(x0 + x, y0 + y, true);
            let chain = self.pixel_chain(x0 + x, y0 + y, true);
            Cell {
                event: verdict.needs_samples(),
                kinds: verdict.kinds() | chain.kinds,
                distance: verdict.distance().min(chain.distance),
            }
        })
    }

    /// The map of what pixels see in mirrors and through glass.
    pub fn chain_map(&self, [x0, y0, w, h]: [u32; 4]) -> Vec<Cell> {
        rows(w, h, |x, y| {
            let Events { kinds, distance, .. } = self.pixel_chain(x0 + x, y0 + y, true);
            Cell { event: kinds != super::Kinds::NONE, kinds, distance }
        })
    }

    /// The map of a light, a shape: what each pixel centre's first hit sees of it. Borders of its highlights are in the kinds; they
    /// are no event.
    pub fn light_map(&self, light: u32, [x0, y0, w, h]: [u32; 4]) -> Vec<Cell> {
        rows(w, h, |x, y| {
            let hit = self.first_hit(x0 + x, y0 + y);
            let verdict = hit.map(|(ray, at)| self.light(light, &Receiver::new(&at, -ray.d), true));
            let (event, distance) = match verdict {
                Some(LightVerdict::Partial(e) | LightVerdict::Unknown(e)) => (true, e.distance),
                _ => (false, f64::INFINITY),
            };
            let seen = verdict.is_some_and(|v| v != LightVerdict::Blocked);
            let gloss = hit.filter(|_| seen).and_then(|(ray, at)| self.highlight(light, &at, -ray.d));
            let highlight = if gloss.is_some() { Kinds::HIGHLIGHT } else { Kinds::NONE };
            let distance = gloss.map_or(distance, |e| distance.min(e.distance));
            Cell { event, kinds: verdict.map_or(Kinds::NONE, |v| v.kinds()) | highlight, distance }
        })
    }
}

pub(super) fn rows(w: u32, h: u32, cell: impl Fn(u32, u32) -> Cell + Sync) -> Vec<Cell> {
    (0..h).into_par_iter().flat_map_iter(|y| (0..w).map(|x| cell(x, y)).collect::<Vec<_>>()).collect()
}
