//! A coated plate on a floor, below a screen with a hole to the sky.

use super::super::gather_cache::GatherCache;
use super::super::surfel_light::{HitLight, SurfelSettings};
use super::super::surfels::Facet;
use super::*;
use crate::accel::Ray;
use crate::math::{DVec3, Sampler, warp};
use crate::scene::description::*;
use crate::scene::material::{Distribution, Roughness};
use crate::scene::{Color, Scalar};
use crate::transport::tests::{Room, add, add_material, add_screened_floor, empty, moments, square};

/// Extent of the hole along x and z.
const HOLE: [f64; 2] = [0.3, 1.1];
/// Gather rays.
const RAYS: u32 = 352;
/// Radiance of the screen; that of the sky is 1.
const SCREEN: f32 = 0.02;
/// Samples of an estimate.
const SAMPLES: u64 = 40_000;

/// The scene, with a plate of the roughness `alpha`.
fn room(alpha: f32, screened: bool) -> Room {
    coated_room(alpha, screened, 1.0)
}

/// The same with a coat that reflects `specular` of what it should.
fn coated_room(alpha: f32, screened: bool, specular: f32) -> Room {
    let mut scene = empty();
    scene.lights = vec![LightDesc::Constant { radiance: Rgb::ONE }];
    if screened {
        add_screened_floor(&mut scene, HOLE);
    }
    let alpha = || Scalar::Constant(alpha);
    let plastic = Material::RoughPlastic {
        eta: 1.5,
        diffuse_reflectance: Color::Constant(Rgb::splat(0.2)),
        specular_reflectance: Color::Constant(Rgb::splat(specular)),
        nonlinear: false,
        roughness: Roughness { distribution: Distribution::Ggx, alpha_u: alpha(), alpha_v: alpha() },
    };
    assert!(is_of_use(std::slice::from_ref(&plastic)));
    let plastic = add_material(&mut scene, plastic);
    add(&mut scene, GeometryDesc::Rectangle, square(DVec3::Y * 0.01, DVec3::Y, 0.1), plastic);
    Room::new(scene)
}

/// What a record in the middle of the plate tells.
struct Lit {
    guides: GlossyGuides,
    gather: GatherCache,
    rest: Bsdf,
    wo: Vec3,
}

impl Lit {
    /// The eye sees the hole mirrored, `aside` from its middle.
    fn new(room: &Room, aside: f32) -> Self {
        let world = room.world();
        let wo = Vec3::new(-0.7 + aside, 1.0, -0.7).normalize();
        let ray = Ray { o: Vec3::Y * 0.5, d: Vec3::NEG_Y, tmin: 0.0, tmax: 9.0 };
        let at = world.surface(&ray, &room.accel.closest(&ray).expect("the plate"));
        let settings = SurfelSettings { light_samples: 1, gather_rays: 1, bounces: None, seed: 1 };
        let mut light = SurfelLight::new(0.1, settings);
        let mut gather = GatherCache::new(RAYS, 7);
        gather.gather(&world, &mut light.surfels, &[Facet::seen_from(&at, wo)], None);
        // The irradiance that makes a surface of albedo 0.5 shine so.
        let total = |_: Vec3, _: Vec3| Rgb::splat(SCREEN * PI / 0.5);
        light.extend(&world, &HitLight::Map { total: &total }, RAYS as usize);
        let guides = GlossyGuides::new(&world, &gather, &light);
        let (_, rest) = world.bsdf(&at, wo).split();
        Lit { guides, gather, rest: rest.expect("a coat"), wo }
    }

    fn guide(&self) -> Option<Guide<'_>> {
        self.guides.guide(&self.gather, 0, &self.rest, self.wo)
    }

    fn guide_from(&self, wo: Vec3) -> Option<Guide<'_>> {
        self.guides.guide(&self.gather, 0, &self.rest, wo)
    }
}

/// Radiance from the unit direction `d`.
fn radiance(d: Vec3) -> f64 {
    let [x, z] = [d.x, d.z].map(|v| f64::from(v / d.y) * 0.99);
    let hole = HOLE[0]..HOLE[1];
    if hole.contains(&x) && hole.contains(&z) { 1.0 } else { f64::from(SCREEN) }
}

/// A direction above the plate, with the density cos / pi.
fn above(u: Vec3) -> Vec3 {
    Frame::from_normal(Vec3::Y).to_world(warp::sample_cosine_hemisphere(u.truncate()))
}

/// Mean of `of` over `SAMPLES` stratified points of the unit cube: mean, standard deviation of one, standard error.
fn mean(seed: u64, of: impl Fn(Vec3) -> f64) -> [f64; 3] {
    let block = Sampler::new(seed, 1, 0).next_block(SAMPLES as u32);
    let one = |k: u32| {
        let [x, y, z, _] = block.point(k);
        of(Vec3::new(x, y, z))
    };
    moments(&(0..SAMPLES as u32).map(one).collect::<Vec<f64>>())
}

#[test]
fn directions_have_the_density_that_is_told() {
    for (alpha, aside) in [(0.15, 0.0), (0.3, 0.0), (0.3, 0.5), (0.5, 0.0)] {
        let room = room(alpha, true);
        let lit = Lit::new(&room, aside);
        let guide = lit.guide().expect("the hole is bright");
        let rest = Rest { bsdf: &lit.rest, guide: Some(&guide) };
        // Sums of f, of f where x > z, of f L and of p, over directions and over the hemisphere.
        let tests: [&dyn Fn(Vec3) -> f64; 3] = [&|_| 1.0, &|d| f64::from(u8::from(d.x > d.z)), &radiance];
        for (k, test) in tests.into_iter().enumerate() {
            let sampled = mean(1, |u| {
                let Some((s, of_lobe)) = guide.sample(&lit.rest, lit.wo, u) else { return 0.0 };
                let (f, pdf) = rest.eval_pdf(lit.wo, s.wi);
                assert!((s.pdf_dir - pdf).abs() <= 1e-3 * pdf && (f / pdf - s.weight).abs().x <= 1e-3 * s.weight.x);
                assert!(pdf >= (1.0 - MOST) * 0.999 * of_lobe, "{pdf} {of_lobe}");
                f64::from(s.weight.x) * test(s.wi)
            });
            let whole = mean(2, |u| {
                let d = above(u);
                let (f, _) = rest.eval_pdf(lit.wo, d);
                f64::from(f.x * PI / d.y) * test(d)
            });
            let error = sampled[2].hypot(whole[2]);
            assert!(error < 0.05 * whole[0], "{alpha} {aside} {k}: no power, {error} of {}", whole[0]);
            assert!((sampled[0] - whole[0]).abs() < 5.0 * error, "{alpha} {aside} {k}: {sampled:?}, not {whole:?}");
        }
        let found = mean(3, |u| f64::from(u8::from(guide.sample(&lit.rest, lit.wo, u).is_some())));
        let whole = mean(4, |u| {
            let d = above(u);
            let (f, pdf) = rest.eval_pdf(lit.wo, d);
            if f.x > 0.0 { f64::from(pdf * PI / d.y) } else { 0.0 }
        });
        assert!(
            (found[0] - whole[0]).abs() < 5.0 * found[2].hypot(whole[2]),
            "{alpha}: {found:?}, p sums to {whole:?}"
        );
    }
}

#[test]
fn less_noise_where_the_record_is_right() {
    for (alpha, aside, most) in [(0.15, 0.0, 0.7), (0.2, 0.6, 0.4), (0.3, 0.0, 0.4), (0.5, 0.0, 0.3)] {
        let room = room(alpha, true);
        let lit = Lit::new(&room, aside);
        let guide = lit.guide().expect("the hole is bright");
        let guided = mean(5, |u| {
            guide.sample(&lit.rest, lit.wo, u).map_or(0.0, |(s, _)| f64::from(s.weight.x) * radiance(s.wi))
        });
        let alone = mean(6, |u| {
            let s = lit.rest.sample(lit.wo, u.z, u.truncate(), Transport::Radiance);
            s.map_or(0.0, |s| f64::from(s.weight.x) * radiance(s.wi))
        });
        let relative = |[mean, square, _]: [f64; 3]| square * square / (mean * mean) - 1.0;
        assert!(relative(guided) < most * relative(alone), "{alpha} {aside}: {} {}", relative(guided), relative(alone));
    }
}

#[test]
fn lobes_that_need_no_guide_have_none() {
    assert!(Lit::new(&room(0.003, true), 0.0).guide().is_none(), "narrower than a cell");
    assert!(Lit::new(&room(0.3, false), 0.0).guide().is_none(), "all directions are alike");
    let lit = Lit::new(&coated_room(0.3, true, 0.0), 0.0);
    assert!(lit.guides.cells.len() > 3 && lit.guide().is_none(), "a black coat");
    let lit = Lit::new(&room(0.3, true), 0.0);
    assert!(lit.guide().is_some() && lit.guide_from(-lit.wo).is_none(), "seen from behind");
}
