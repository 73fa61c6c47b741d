//! A closed box with a small bright spot on one wall, whose irradiance at any place is an integral over that wall.

use super::super::bright_patches;
use super::super::gather_strata::Estimate;
use super::super::surfel_light::{HitLight, SurfelSettings};
use super::super::surfels::Facet;
use super::*;
use crate::math::{DMat4, luminance};
use crate::scene::description::GeometryDesc;
use crate::transport::sightings::Teller;
use crate::transport::tests::{Room, add, diffuse, empty, moments, screened_floor, through_hole};

const ALBEDO: f32 = 0.5;
/// Gather rays.
const RAYS: u32 = 256;
/// Irradiance of the spot's middle, over that of all other surfaces, and its width: a record has a third of a gather ray on it, or less.
const SPOT: [f32; 2] = [4000.0, 0.03];
/// One that some records in a hundred meet.
const SMALLEST: [f32; 2] = [36_000.0, 0.01];
const MIDDLE: Vec3 = Vec3::new(1.0, 0.2, -0.3);

/// `[-1, 1]^3`.
fn closed_box() -> Room {
    let mut scene = empty();
    let wall = diffuse(&mut scene, ALBEDO);
    add(&mut scene, GeometryDesc::Cube, DMat4::IDENTITY, wall);
    scene.shapes[0].flip_normals = true;
    Room::new(scene)
}

/// Irradiance of the walls: 1, and a Gaussian bell.
fn walls([height, width]: [f32; 2]) -> impl Fn(Vec3, Vec3) -> Rgb + Sync {
    move |p, _| {
        let on_wall = if p.x > 0.999 { 1.0 } else { 0.0 };
        Rgb::splat(1.0 + on_wall * height * (-0.5 * (p - MIDDLE).length_squared() / (width * width)).exp())
    }
}

/// What [`walls`] sends to a place, by the midpoint rule over the spot.
fn expected(place: &Facet, spot: [f32; 2]) -> f64 {
    let [height, width] = spot.map(f64::from);
    let (steps, reach) = (80, 5.0 * width);
    let step = 2.0 * reach / f64::from(steps);
    let mut sum = 0.0;
    for i in 0..steps * steps {
        let [y, z] = [i / steps, i % steps].map(|k| (f64::from(k) + 0.5) * step - reach);
        let to = (MIDDLE - place.p).as_dvec3() + crate::math::DVec3::new(0.0, y, z);
        let (cos, cos_wall) = (to.dot(place.n_geo.as_dvec3()).max(0.0), to.x.max(0.0));
        let bell = height * (-0.5 * (y * y + z * z) / (width * width)).exp();
        sum += bell * cos * cos_wall / (to.length_squared().powi(2) * std::f64::consts::PI) * step * step;
    }
    f64::from(ALBEDO) * (1.0 + sum)
}

/// Places on the other walls.
fn places(room: &Room) -> Vec<Facet> {
    let world = room.world();
    let seen = |i: u64| {
        let d = warp::sample_sphere(Sampler::new(5, 1, i).next_2d());
        let eye = Vec3::new(-0.2, 0.1, 0.3);
        let g = world.gather(eye, d, &mut Sampler::new(5, 2, i), &mut RayCounts::default(), |_| {});
        g.end.map(|end| Facet::seen_from(&end.at, end.wo))
    };
    (0..150).filter_map(seen).filter(|f| f.p.x < 0.9).collect()
}

/// The first records, with these estimates.
fn tellers<'c>(cache: &'c GatherCache, estimates: &[Estimate]) -> Vec<Teller<'c>> {
    let tell = |(i, e): (usize, &Estimate)| Teller {
        place: cache.places()[i],
        level: luminance(e.irradiance),
        hits: cache.hits(i),
        sky: cache.sky(i),
    };
    estimates.iter().enumerate().map(tell).collect()
}

/// Mean and root mean square of the relative errors, and the standard error of the mean.
fn errors(estimates: &[Estimate], places: &[Facet], spot: [f32; 2]) -> [f64; 3] {
    let error = |(e, place): (&Estimate, &Facet)| f64::from(luminance(e.irradiance)) / expected(place, spot) - 1.0;
    moments(&estimates.iter().zip(places).map(error).collect::<Vec<f64>>())
}

#[test]
fn guided_rays_keep_the_mean_and_lower_the_variance() {
    let room = closed_box();
    let world = room.world();
    let facets = places(&room);
    let settings = SurfelSettings { light_samples: 1, gather_rays: 1, bounces: None, seed: 1 };
    // Cells much smaller than the spot.
    let mut light = SurfelLight::new(0.006, settings);
    let total = walls(SPOT);
    let hit_light = HitLight::Map { total: &total };
    let mut cache = GatherCache::new(RAYS, 7);
    // Half of the records tell where the spot is, all are guided to it.
    let half = facets.len() / 2;
    for range in [0..half, half..facets.len()] {
        cache.gather(&world, &mut light.surfels, &facets[range], None);
        light.extend(&world, &hit_light, cache.len() * RAYS as usize);
    }
    let alone = cache.evaluate(0..cache.len(), &light);
    let patches = bright_patches::find(&light.surfels, light.irradiance(), &tellers(&cache, &alone[..half]));
    assert!(!patches.is_empty() && patches.iter().all(|p| (p.center - MIDDLE).length() < 0.2), "{patches:?}");
    let before = cache.counts.rays;
    cache.guide(&world, &mut light.surfels, Guides { patches: &patches, sightings: None });
    light.extend(&world, &hit_light, cache.len() * RAYS as usize);
    let guided = cache.evaluate(0..cache.len(), &light);
    let more = (cache.counts.rays - before) as f64 / (facets.len() as f64 * f64::from(RAYS));
    assert!(more < 0.5, "{more} rays for each gather ray");

    let ([_, plain, _], [mean, rms, sigma]) = (errors(&alone, &facets, SPOT), errors(&guided, &facets, SPOT));
    assert!(plain > 0.5, "the spot is no small one: {plain}");
    assert!(rms < plain / 15.0, "{rms} with guided rays, {plain} without");
    assert!(mean.abs() < 0.003 + 3.0 * sigma, "{mean} +- {sigma}");

    // Rays of both kinds that count in full bring the spot twice.
    cache.guided.shares.fill(1.0);
    let [twice, _, sigma] = errors(&cache.evaluate(0..cache.len(), &light), &facets, SPOT);
    assert!(twice > 0.1 + 3.0 * sigma, "counted twice: {twice} +- {sigma}");
}

/// Records that sent rays to a patch which only they have found would bring less of it: the rest of the time they would not have known.
#[test]
fn records_must_not_be_guided_by_what_they_found_themselves() {
    let room = closed_box();
    let world = room.world();
    let facets: Vec<Facet> = places(&room).into_iter().take(64).collect();
    let total = walls(SMALLEST);
    let hit_light = HitLight::Map { total: &total };
    // Mean relative errors of records whose patches were found by the rays of seed `told`.
    let guided = |seed: u64, told: u64| {
        let settings = SurfelSettings { light_samples: 1, gather_rays: 1, bounces: None, seed: 1 };
        let mut light = SurfelLight::new(0.002, settings);
        let gathered = |light: &mut SurfelLight, seed| {
            let mut cache = GatherCache::new(RAYS, seed);
            cache.gather(&world, &mut light.surfels, &facets, None);
            light.extend(&world, &hit_light, cache.len() * RAYS as usize);
            cache
        };
        let telling = gathered(&mut light, told);
        let alone = telling.evaluate(0..telling.len(), &light);
        let patches = bright_patches::find(&light.surfels, light.irradiance(), &tellers(&telling, &alone));
        let mut cache = gathered(&mut light, seed);
        cache.guide(&world, &mut light.surfels, Guides { patches: &patches, sightings: None });
        light.extend(&world, &hit_light, cache.len() * RAYS as usize);
        errors(&cache.evaluate(0..cache.len(), &light), &facets, SMALLEST)[0]
    };
    let mean = |other: u64| (0..40).map(|seed| guided(seed, seed + other)).sum::<f64>() / 40.0;
    let (own, others) = (mean(0), mean(1000));
    assert!(others.abs() < 0.07, "{others} by the patches of others");
    assert!(own < -0.08, "{own} by their own");
}

#[test]
fn what_others_saw_of_a_small_spot_or_window_keeps_the_mean_and_lowers_the_variance() {
    // A spot that a few gather rays meet: half of the records tell, the others are guided.
    let (room, spot) = (closed_box(), [400.0, 0.1]);
    let world = room.world();
    let facets = places(&room);
    let half = facets.len() / 2;
    let total = walls(spot);
    let hit_light = HitLight::Map { total: &total };
    let settings = SurfelSettings { light_samples: 1, gather_rays: 1, bounces: None, seed: 1 };
    let mut light = SurfelLight::new(0.02, settings);
    let mut telling = GatherCache::new(RAYS, 7);
    telling.gather(&world, &mut light.surfels, &facets[..half], None);
    light.extend(&world, &hit_light, half * RAYS as usize);
    let told = telling.evaluate(0..half, &light);
    let sightings = Sightings::of(light.irradiance(), &tellers(&telling, &told)).expect("the spot is bright");
    let (mut plain, mut guided) = (Vec::new(), Vec::new());
    let mut twice = Vec::new();
    for seed in 0..6 {
        let mut cache = GatherCache::new(RAYS, 100 + seed);
        cache.gather(&world, &mut light.surfels, &facets[half..], None);
        light.extend(&world, &hit_light, half * RAYS as usize);
        plain.extend(cache.evaluate(0..cache.len(), &light));
        let before = cache.counts.rays;
        cache.guide(&world, &mut light.surfels, Guides { patches: &[], sightings: Some(&sightings) });
        light.extend(&world, &hit_light, half * RAYS as usize);
        guided.extend(cache.evaluate(0..cache.len(), &light));
        let more = (cache.counts.rays - before) as f64 / (cache.len() as f64 * f64::from(RAYS));
        assert!(more > 0.02 && more <= 1.0, "{more} rays for each gather ray");
        cache.guided.shares.fill(1.0);
        twice.extend(cache.evaluate(0..cache.len(), &light));
    }
    let repeated: Vec<Facet> = (0..6).flat_map(|_| facets[half..].to_vec()).collect();
    let [[_, plain, _], [mean, rms, sigma]] = [&plain, &guided].map(|all| errors(all, &repeated, spot));
    assert!(rms < 0.6 * plain, "{rms} with further rays, {plain} without");
    assert!(mean.abs() < 0.005 + 3.0 * sigma, "{mean} +- {sigma}");
    let [twice, _, sigma] = errors(&twice, &repeated, spot);
    assert!(twice > 0.05 + 3.0 * sigma, "counted twice: {twice} +- {sigma}");

    // The sky through a hole that a record meets by one ray or none.
    let hole = [0.05, 0.15];
    let room = screened_floor(hole);
    let world = room.world();
    let on_floor = |salt: u64| -> Vec<Facet> {
        let down = |i: u64| {
            let u = Sampler::new(6, salt, i).next_2d();
            let eye = Vec3::new(u.x - 0.5, 0.5, u.y - 0.5);
            let g = world.gather(eye, -Vec3::Y, &mut Sampler::new(6, 0, i), &mut RayCounts::default(), |_| {});
            g.end.map(|end| Facet::seen_from(&end.at, end.wo))
        };
        (0..400).filter_map(down).collect()
    };
    let (speakers, listeners) = (on_floor(1), on_floor(2));
    let gathered = |facets: &[Facet], seed, sightings: Option<&Sightings>| {
        let mut surfels = Surfels::new(0.1);
        let mut cache = GatherCache::new(RAYS, seed);
        cache.gather(&world, &mut surfels, facets, sightings);
        cache
    };
    let telling = gathered(&speakers, 1, None);
    let told = |(i, place): (usize, &Facet)| Teller {
        place: *place,
        level: through_hole(hole, place.p) as f32,
        hits: telling.hits(i),
        sky: telling.sky(i),
    };
    let told: Vec<Teller> = speakers.iter().enumerate().map(told).collect();
    let sightings = Sightings::of(&[], &told).expect("the hole is bright");
    let errors = |sightings: Option<&Sightings>| {
        let cache = gathered(&listeners, 2, sightings);
        let got = |i: usize| cache.sky(i).iter().map(|l| f64::from(l.x)).sum::<f64>() * std::f64::consts::PI / 256.0;
        let error = |i: usize| got(i) / through_hole(hole, listeners[i].p) - 1.0;
        moments(&(0..listeners.len()).map(error).collect::<Vec<f64>>())
    };
    let [[_, alone, _], [mean, rms, sigma]] = [None, Some(&sightings)].map(errors);
    assert!(rms < 0.5 * alone, "{rms} with further rays, {alone} without");
    assert!(mean.abs() < 3.0 * sigma, "{mean} +- {sigma}");
}

#[test]
fn rays_of_a_cone_have_its_density_and_cells_know_their_directions() {
    // The mean over guided rays alone of cos / pdf is the projected solid angle pi sin^2 of a cone around the normal.
    let cone = Cone { axis: Vec3::Z, one_minus_cos: 0.1, rays: 4096 };
    let draw = |i: u32| direction(&cone, i, 0.3, unit_f32(hash(3, u64::from(i))));
    let sum: f32 = (0..cone.rays).map(|i| draw(i).z).sum();
    let got = sum / cone.rays as f32 / warp::pdf_cone(cone.one_minus_cos);
    let expected = std::f32::consts::PI * (1.0 - 0.9 * 0.9);
    assert!((got / expected - 1.0).abs() < 1e-3, "{got}, not {expected}");
    let strata = crate::transport::gather_strata::Strata::new(RAYS);
    for i in 0..strata.len() {
        let u = Vec2::new(0.01 + 0.98 * unit_f32(hash(4, i as u64)), 0.01 + 0.98 * unit_f32(hash(5, i as u64)));
        assert_eq!(strata.cell(strata.direction(i, u)), i);
    }
}
