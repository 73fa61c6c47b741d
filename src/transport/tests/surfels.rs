//! Which cells surfels stand for.

use super::*;
use crate::math::{Vec2, luminance};
use crate::transport::gather_ray::{GatherEnd, RayCounts};
use crate::transport::surfel_demand::Demand;
use crate::transport::surfel_light::{HitLight, SurfelLight, SurfelSettings};
use crate::transport::surfels::{Facet, Surfels};

/// A floor at y = 0 with `on_it`.
fn floor_with(on_it: Option<(GeometryDesc, DMat4, Material)>) -> Room {
    let mut desc = empty();
    let white = diffuse(&mut desc, 0.5);
    add(&mut desc, GeometryDesc::Rectangle, square(DVec3::ZERO, DVec3::Y, 100.0), white);
    if let Some((geometry, to_world, material)) = on_it {
        let material = add_material(&mut desc, material);
        add(&mut desc, geometry, to_world, material);
    }
    Room::new(desc)
}

fn gathered(room: &Room, o: Vec3, d: Vec3) -> GatherEnd {
    room.world().gather(o, d.normalize(), &mut Sampler::new(1, 1, 1), &mut RayCounts::default(), |_| {})
}

#[test]
fn the_last_part_of_a_chain_begins_at_the_last_mirror_or_lens() {
    let ball = || GeometryDesc::Sphere { center: DVec3::new(0.0, 0.4, 0.0), radius: 0.4 };
    let down = [Vec3::new(0.01, 3.0, 0.02), Vec3::new(0.0, -1.0, 0.0)];
    // Nothing on the way: all of it.
    let free = gathered(&floor_with(None), down[0], down[1]);
    assert!((free.last - 3.0).abs() < 1e-5 && free.last == free.distance, "{free:?}");
    // Through a ball of glass: from where the ray leaves it, or from its last reflection, hardly above the floor.
    let lens = floor_with(Some((ball(), DMat4::IDENTITY, glass(1.5))));
    let through = (0..64).map(|k| {
        let q = Vec2::from_angle(k as f32) * 0.1;
        gathered(&lens, Vec3::new(q.x, 3.0, q.y), down[1])
    });
    let seen: Vec<GatherEnd> = through.filter(|g| g.end.is_some() && g.segments == 3).collect();
    assert!(seen.len() > 40, "{}", seen.len());
    for g in seen {
        assert!(g.distance > 2.9 && g.last < 0.05, "{g:?}");
    }
    // By a mirror on edge: from the mirror.
    let wall = square(DVec3::new(1.0, 1.0, 0.0), -DVec3::X, 1.0);
    let mirrored = gathered(
        &floor_with(Some((GeometryDesc::Rectangle, wall, mirror()))),
        Vec3::new(0.0, 1.5, 0.0),
        Vec3::new(1.0, -0.5, 0.0),
    );
    let half = Vec2::new(1.0, 0.5).length();
    assert!((mirrored.distance - 3.0 * half).abs() < 1e-4 && (mirrored.last - 2.0 * half).abs() < 1e-4, "{mirrored:?}");
}

#[test]
fn cells_double_where_surfels_are_hardly_shared_only() {
    let room = floor_with(None);
    let world = room.world();
    let mut surfels = Surfels::new(0.1);
    // One place in each of 62,500 cells.
    for i in 0..250 {
        for k in 0..250 {
            let p = Vec3::new(0.1 * i as f32 - 12.0, 1.0, 0.1 * k as f32 - 12.0);
            let end = gathered(&room, p, -Vec3::Y).end.expect("the floor is there");
            surfels.find_or_insert(&world, &Facet::seen_from(&end.at, end.wo), f32::INFINITY);
        }
    }
    assert!(surfels.len() > 62_000, "{}", surfels.len());
    // Five rays to a surfel.
    surfels.coarsen(5 * surfels.len());
    assert_eq!(surfels.cell(), 0.1);
    // Hardly more rays than surfels, as in hair.
    surfels.coarsen(surfels.len() * 3 / 2);
    assert_eq!(surfels.cell(), 0.2);
}

#[test]
fn further_light_samples_keep_the_mean_and_go_where_records_want_them() {
    let hole = [-0.25, 0.25];
    let room = screened_floor(hole);
    let world = room.world();
    let dark = |_: Vec3, _: Vec3| Rgb::ZERO;
    let (mut before, mut after, mut left) = (Vec::new(), Vec::new(), Vec::new());
    let mut most = 0;
    for seed in 0..4 {
        let settings = SurfelSettings { light_samples: 4, gather_rays: 1, bounces: Some(0), seed };
        let mut light = SurfelLight::new(0.02, settings);
        for i in 0..900 {
            let [x, z] = [i / 30, i % 30].map(|k| 0.02 * k as f32 - 0.3);
            let end = gathered(&room, Vec3::new(x, 0.5, z), -Vec3::Y).end.expect("the floor is there");
            light.surfels.find_or_insert(&world, &Facet::seen_from(&end.at, end.wo), f32::INFINITY);
        }
        light.extend(&world, &HitLight::OneBounce { caustic: &dark }, 100_000);
        // One record sees the first half of them.
        let half = light.surfels.len() / 2;
        let mut demand = Demand::default();
        demand.add((0..half as u32).map(|k| (k, 1.0)).collect());
        let error = |light: &SurfelLight, k: usize| {
            f64::from(luminance(light.own[k])) / through_hole(hole, light.surfels.places()[k].p) - 1.0
        };
        before.extend((0..half).map(|k| error(&light, k)));
        let unwanted = light.samples[half + 1];
        assert!(light.sharpen(&world, &demand), "a hole that few samples find");
        after.extend((0..half).map(|k| error(&light, k)));
        left.extend((half..light.surfels.len()).map(|k| light.samples[k] - unwanted));
        most = most.max(light.samples[..half].iter().copied().max().unwrap_or(0));
    }
    assert!(left.iter().all(|more| *more == 0), "samples where none are wanted");
    assert!(most > 12, "{most} samples");
    let ([_, plain, _], [mean, rms, sigma]) = (moments(&before), moments(&after));
    // Four times the samples and more.
    assert!(rms * rms < 0.35 * plain * plain, "{rms} with further samples, {plain} without");
    assert!(mean.abs() < 4.0 * sigma, "{mean} +- {sigma}");
}
