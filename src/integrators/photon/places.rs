//! Where the eye sees diffuse surfaces: the places that the irradiance cache must cover.
//!
//! The ray through the middle of a pixel and of the lens is followed through Dirac lobes, mirrored and refracted ones alike, without
//! chance. Source: the coarse-to-fine placement is that of Krivanek & Gautron 2009, section 3.5 (several levels of the pixel grid).

use crate::accel::Ray;
use crate::math::Vec2;
use crate::scene::Transport;
use crate::scene::camera::CameraRay;
use crate::transport::{MAX_PASSED_SURFACES, Place, World};
use arrayvec::ArrayVec;
use rayon::prelude::*;

/// Dirac scatterings followed, at most.
const MOST_SCATTERINGS: u32 = 6;
/// Rays of less weight than this are not worth a record of their own.
const FAINT: f32 = 0.02;

/// Places seen through those pixels of `window` (x, y, width, height) whose column and row are multiples of `spacing`, but not both of
/// `known`; in rows from the top. `hide_emitters`: through lamps.
pub fn places(world: World, window: [u32; 4], spacing: u32, known: Option<u32>, hide_emitters: bool) -> Vec<Place> {
    let [x0, y0, width, height] = window;
    let is_known = |x: u32, y: u32| known.is_some_and(|k| x.is_multiple_of(k) && y.is_multiple_of(k));
    let rows: Vec<u32> = (0..height).step_by(spacing as usize).collect();
    let rows: Vec<Vec<Place>> = rows
        .par_iter()
        .map(|&y| {
            let mut found = Vec::new();
            for x in (0..width).step_by(spacing as usize).filter(|&x| !is_known(x, y)) {
                let pixel = Vec2::new((x0 + x) as f32 + 0.5, (y0 + y) as f32 + 0.5);
                seen(world, pixel, hide_emitters, &mut found);
            }
            found
        })
        .collect();
    rows.concat()
}

/// A ray, the distance travelled before, its weight and scatterings.
struct Way {
    ray: Ray,
    before: f32,
    weight: f32,
    scatterings: u32,
}

/// Places seen through the middle of a pixel.
fn seen(world: World, pixel: Vec2, hide_emitters: bool, found: &mut Vec<Place>) {
    let camera = &world.scene.camera;
    let CameraRay { o, d, tmin, tmax, .. } = camera.ray(pixel, Vec2::splat(0.5));
    let size = PixelSize::new(world, pixel);
    let mut waiting = ArrayVec::<Way, 8>::new();
    waiting.push(Way { ray: Ray { o, d, tmin, tmax }, before: 0.0, weight: 1.0, scatterings: 0 });
    let mut passed = 0;
    while let Some(way) = waiting.pop() {
        let Some(hit) = world.accel.closest(&way.ray) else { continue };
        let at = world.surface(&way.ray, &hit);
        let wo = -way.ray.d;
        let travelled = way.before + hit.t;
        if hide_emitters && way.scatterings == 0 && world.scene.shapes[at.shape as usize].emission.is_some() {
            passed += 1;
            if passed <= MAX_PASSED_SURFACES {
                let ray = Ray { tmax: way.ray.tmax - hit.t, ..Ray::leaving(&at, way.ray.d) };
                let _ = waiting.try_push(Way { ray, before: travelled, ..way });
            }
            continue;
        }
        let (diffuse, rest) = world.bsdf(&at, wo).split();
        if diffuse.is_some() {
            found.push(Place::new(&at, wo, size.at(travelled)));
        }
        let Some(branches) = rest.and_then(|r| r.branches(wo, Transport::Radiance)) else { continue };
        for s in branches {
            let straight = s.lobe == crate::scene::LobeKind::Null;
            passed += u32::from(straight);
            let scatterings = way.scatterings + u32::from(!straight);
            let weight = way.weight * (s.weight * (s.eta * s.eta)).max_element();
            if scatterings <= MOST_SCATTERINGS && weight > FAINT && passed <= MAX_PASSED_SURFACES {
                let ray = Ray::leaving(&at, s.wi);
                let _ = waiting.try_push(Way { ray, before: travelled, weight, scatterings });
            }
        }
    }
}

/// Width of a pixel on a plane across the ray.
struct PixelSize {
    constant: f32,
    by_distance: f32,
}

impl PixelSize {
    fn new(world: World, pixel: Vec2) -> Self {
        let camera = &world.scene.camera;
        let [a, b] = [pixel, pixel + Vec2::X].map(|p| camera.ray(p, Vec2::splat(0.5)));
        PixelSize { constant: (a.o - b.o).length(), by_distance: (a.d - b.d).length() }
    }

    fn at(&self, distance: f32) -> f32 {
        self.constant + self.by_distance * distance
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::{DVec3, Rgb};
    use crate::scene::Color;
    use crate::scene::description::GeometryDesc;
    use crate::transport::tests::{Room, add, diffuse, empty, square};

    #[test]
    fn places_lie_behind_hidden_lamps() {
        // The camera is ten units above the floor and looks down.
        let mut scene = empty();
        let grey = diffuse(&mut scene, 0.5);
        add(&mut scene, GeometryDesc::Rectangle, square(DVec3::ZERO, DVec3::Y, 4.0), grey);
        for height in [5.0, 6.0] {
            add(&mut scene, GeometryDesc::Rectangle, square(DVec3::Y * height, DVec3::Y, 1.0), grey);
            scene.shapes.last_mut().unwrap().emission = Some(Color::Constant(Rgb::ONE));
        }
        let room = Room::new(scene);
        let middle = |hide_emitters: bool| places(room.world(), [32, 32, 1, 1], 1, None, hide_emitters)[0];
        let (hidden, shown) = (middle(true), middle(false));
        assert!(hidden.facet.p.y.abs() < 1e-4 && (shown.facet.p.y - 6.0).abs() < 1e-4, "{hidden:?} {shown:?}");
        // As wide as a pixel is at the whole distance.
        assert!((hidden.pixel / shown.pixel - 2.5).abs() < 1e-3, "{} {}", hidden.pixel, shown.pixel);
    }
}
