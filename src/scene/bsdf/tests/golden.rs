//! Values of the models against Mitsuba 3.9.1 (variant `scalar_rgb`): eval and pdf at twenty pairs of directions, and
//! the Dirac samples. Each table row holds (green channel of f cos, pdf) for the pair of the same index.

#![allow(clippy::approx_constant)] // 1/pi, rounded

use super::*;

/// Greatest deviation from a table, relative to the value plus a thousandth, of the value and of the pdf. The material is
/// the last one.
fn deviation(materials: &[Material], at: &SurfacePoint, table: &[[f32; 2]; 20]) -> (f32, f32) {
    let (textures, images) = textures();
    let t = Textures { textures: &textures, images: &images };
    let (mut worst_f, mut worst_pdf) = (0f32, 0f32);
    for ((wo, wi), &[f, pdf]) in PAIRS.iter().zip(table) {
        let (wo, wi) = (Vec3::from(*wo).normalize(), Vec3::from(*wi).normalize());
        let bsdf = Bsdf::new(materials, materials.len() as u32 - 1, t, at, wo);
        let (ours, our_pdf) = bsdf.eval_pdf(wo, wi, Transport::Radiance);
        let relative = |x: f32, y: f32| (x - y).abs() / (y.abs() + 1e-3);
        worst_f = worst_f.max(relative(ours.y, f));
        worst_pdf = worst_pdf.max(relative(our_pdf, pdf));
    }
    println!("values within {worst_f:.1e}, pdfs within {worst_pdf:.1e}");
    (worst_f, worst_pdf)
}

/// Values and pdfs agree to rounding.
fn agrees(material: Material, table: &[[f32; 2]; 20]) {
    let (f, pdf) = deviation(&[material], &flat(), table);
    assert!(f < 2e-4 && pdf < 2e-4, "{f} {pdf}");
}

/// Values agree to rounding; pdfs are normalised by the exact projected area here, by Walter's fit there.
fn agrees_beckmann(material: Material, table: &[[f32; 2]; 20]) {
    let (f, pdf) = deviation(&[material], &flat(), table);
    assert!(f < 3e-4 && pdf < 5e-3, "{f} {pdf}");
}

#[test]
fn diffuse_agrees() {
    agrees(diffuse(0.5), &DIFFUSE);
}

#[test]
fn metals_agree() {
    agrees(metal(rough(Distribution::Ggx, 0.2, 0.5)), &GGX_ANISOTROPIC_METAL);
    agrees_beckmann(metal(rough(Distribution::Beckmann, 0.3, 0.3)), &BECKMANN_METAL);
}

#[test]
fn rough_glass_agrees() {
    agrees(glass(1.5, rough(Distribution::Ggx, 0.4, 0.4)), &GGX_GLASS);
    agrees_beckmann(glass(1.0 / 1.33, rough(Distribution::Beckmann, 0.3, 0.3)), &BECKMANN_GLASS);
}

#[test]
fn plastics_agree() {
    agrees(plastic(1.5, 0.6, 0.8, false, None), &PLASTIC);
    agrees(plastic(1.9, 0.6, 1.0, true, None), &NONLINEAR_PLASTIC);
}

/// Both sides interpolate tables of the transmittance.
#[test]
fn rough_plastics_agree() {
    let beckmann = plastic(1.49, 0.5, 1.0, false, Some(rough(Distribution::Beckmann, 0.1, 0.1)));
    let ggx = plastic(1.7, 0.8, 0.7, true, Some(rough(Distribution::Ggx, 0.4, 0.4)));
    for (material, table) in [(beckmann, &BECKMANN_PLASTIC), (ggx, &GGX_PLASTIC)] {
        let (f, pdf) = deviation(&[material], &flat(), table);
        assert!(f < 0.01 && pdf < 0.01, "{f} {pdf}");
    }
}

/// Lobes are chosen by albedo here and by weight there, so that only values agree.
#[test]
fn nesting_agrees() {
    let ggx = |u, v| metal(rough(Distribution::Ggx, u, v));
    let two_sided = Material::TwoSided { front: 0, back: 1 };
    let (f, pdf) = deviation(&[diffuse(0.2), ggx(0.2, 0.5), two_sided], &flat(), &TWOSIDED);
    assert!(f < 2e-4 && pdf < 2e-4, "{f} {pdf}");
    let blend = Material::Blend { weight: Scalar::Constant(0.3), first: 0, second: 1, absorbed: 0.0 };
    let (f, _) = deviation(&[diffuse(0.2), ggx(0.3, 0.3), blend], &flat(), &BLEND);
    assert!(f < 2e-4, "{f}");
    let mask = Material::Mask { opacity: Scalar::Constant(0.3), nested: 0 };
    let (f, _) = deviation(&[diffuse(0.5), mask], &flat(), &MASK);
    assert!(f < 2e-4, "{f}");
}

#[test]
fn maps_of_normals_agree() {
    // Mitsuba 3.9.1 gets the tangent under a bump map wrong (it mixes spaces): no anisotropy there.
    let isotropic = || metal(rough(Distribution::Ggx, 0.3, 0.3));
    let ggx = || metal(rough(Distribution::Ggx, 0.2, 0.5));
    let normal_map = || Material::NormalMap { texture: 1, nested: 0 };
    let bump_map = || Material::BumpMap { texture: 0, scale: 0.4, nested: 0 };
    let two_sided = || Material::TwoSided { front: 1, back: 1 };
    for (materials, table) in [
        (vec![ggx(), normal_map()], &NORMAL_MAP),
        (vec![diffuse(0.5), bump_map()], &BUMP_MAP),
        (vec![ggx(), normal_map(), two_sided()], &TWOSIDED_NORMAL_MAP),
        (vec![isotropic(), bump_map(), two_sided()], &TWOSIDED_BUMP_MAP),
    ] {
        let (f, pdf) = deviation(&materials, &tilted(), table);
        assert!(f < 5e-4 && pdf < 5e-4, "{f} {pdf}");
    }
}

/// (wo, wi, value = weight times probability, eta) of the first and the last sample.
#[test]
fn dirac_samples_agree() {
    let metal =
        Material::Conductor { eta: Color::Constant(ETA), k: Color::Constant(K), specular_reflectance: grey(1.0) };
    let glass = Material::Dielectric { eta: 1.5, specular_reflectance: grey(0.9), specular_transmittance: grey(0.7) };
    let pane =
        Material::ThinDielectric { eta: 1.5, specular_reflectance: grey(1.0), specular_transmittance: grey(1.0) };
    let plastic = plastic(1.5, 0.6, 0.8, false, None);
    #[rustfmt::skip]
    let golden = [
        (&metal, [0.3, 0.1, 0.9], 0.0, [-0.31449, -0.10483, 0.94346], [0.95189, 0.62014, 0.51064], 1.0),
        (&metal, [0.9, 0.1, 0.3], 0.0, [-0.94346, -0.10483, 0.31449], [0.94199, 0.65996, 0.58427], 1.0),
        (&glass, [0.3, 0.1, 0.9], 0.0, [-0.31449, -0.10483, 0.94346], [0.03621; 3], 1.0),
        (&glass, [0.3, 0.1, 0.9], 0.9999, [-0.20966, -0.06989, -0.97527], [0.29859; 3], 1.5),
        (&glass, [0.9, 0.1, 0.3], 0.0, [-0.94346, -0.10483, 0.31449], [0.17471; 3], 1.0),
        (&glass, [0.9, 0.1, 0.3], 0.9999, [-0.62897, -0.06989, -0.77428], [0.25072; 3], 1.5),
        (&glass, [0.3, 0.1, -0.9], 0.0, [-0.31449, -0.10483, -0.94346], [0.03733; 3], 1.0),
        (&glass, [0.3, 0.1, -0.9], 0.9999, [-0.47173, -0.15724, 0.86761], [1.50967; 3], 0.66667),
        (&glass, [0.7, 0.5, -0.4], 0.0, [-0.73786, -0.52705, -0.42164], [0.9; 3], 1.0),
        (&glass, [0.7, 0.5, -0.4], 0.9999, [-0.73786, -0.52705, -0.42164], [0.9; 3], 1.0),
        (&pane, [0.3, 0.1, 0.9], 0.0, [-0.31449, -0.10483, 0.94346], [0.07735; 3], 1.0),
        (&pane, [0.3, 0.1, 0.9], 0.9999, [-0.31449, -0.10483, -0.94346], [0.92265; 3], 1.0),
        (&pane, [0.7, 0.5, -0.4], 0.0, [-0.73786, -0.52705, -0.42164], [0.21588; 3], 1.0),
        (&pane, [0.7, 0.5, -0.4], 0.9999, [-0.73786, -0.52705, 0.42164], [0.78412; 3], 1.0),
        (&plastic, [0.3, 0.1, 0.9], 0.0, [-0.31449, -0.10483, 0.94346], [0.03219; 3], 1.0),
        (&plastic, [0.9, 0.1, 0.3], 0.0, [-0.94346, -0.10483, 0.31449], [0.1553; 3], 1.0),
    ];
    let none = Textures { textures: &[], images: &[] };
    for (material, wo, u, wi, value, eta) in golden {
        let wo = Vec3::from(wo).normalize();
        let bsdf = Bsdf::new(std::slice::from_ref(material), 0, none, &flat(), wo);
        let s = bsdf.sample(wo, u, Vec2::splat(0.5), Transport::Radiance).expect("a sample");
        assert!((s.wi - Vec3::from(wi)).length() < 2e-5, "{material:?}: {}", s.wi);
        assert!((s.eta - eta).abs() < 1e-5 && s.pdf_dir == 0.0 && s.lobe == LobeKind::Specular);
        // The probability of the lobe is how much of u_lobe leads to its direction.
        let same = |i: u32| {
            let t = bsdf.sample(wo, i as f32 / 20_000.0, Vec2::splat(0.5), Transport::Radiance);
            t.is_some_and(|t| (t.wi - s.wi).length() < 1e-6)
        };
        let pmf = (0..20_000).filter(|&i| same(i)).count() as f32 / 20_000.0;
        let ours = s.weight * pmf;
        assert!(
            (ours - Rgb::from(value)).abs().max_element() < 1e-4 * s.weight.max_element() + 1e-5,
            "{material:?} {wo}: {ours}"
        );
    }
    for material in [metal, plastic] {
        let wo = Vec3::new(0.3, 0.1, -0.9).normalize();
        let bsdf = Bsdf::new(&[material], 0, none, &flat(), wo);
        assert!(bsdf.sample(wo, 0.0, Vec2::splat(0.5), Transport::Radiance).is_none(), "black behind");
    }
}

#[rustfmt::skip]
const PAIRS: [([f32; 3], [f32; 3]); 20] = [
    ([0.0, 0.0, 1.0], [0.0, 0.0, 1.0]), ([0.3, 0.1, 0.9], [-0.25, -0.1, 0.9]),
    ([0.6, -0.2, 0.7], [-0.5, 0.3, 0.7]), ([0.9, 0.1, 0.3], [-0.9, -0.2, 0.35]),
    ([0.9, 0.1, 0.3], [0.2, 0.4, 0.8]), ([0.2, 0.4, 0.8], [0.9, 0.1, 0.3]),
    ([0.99, 0.0, 0.05], [-0.98, 0.1, 0.06]), ([-0.3, 0.5, 0.4], [0.6, -0.1, 0.5]),
    ([0.1, -0.7, 0.6], [0.1, 0.8, 0.5]), ([0.5, 0.5, 0.5], [0.3, -0.8, 0.2]),
    ([-0.7, -0.3, 0.2], [-0.4, 0.2, 0.9]), ([0.05, 0.02, 1.0], [-0.6, -0.6, 0.5]),
    ([0.3, 0.1, 0.9], [-0.2, -0.1, -0.9]), ([0.6, -0.2, 0.7], [-0.4, 0.1, -0.85]),
    ([0.9, 0.1, 0.3], [-0.5, -0.2, -0.7]), ([0.1, -0.2, 0.9], [0.3, 0.2, -0.8]),
    ([0.3, 0.1, -0.9], [-0.2, -0.1, -0.9]), ([0.6, -0.2, -0.7], [-0.5, 0.2, -0.6]),
    ([0.3, 0.1, -0.9], [-0.4, -0.15, 0.9]), ([0.4, -0.2, -0.7], [-0.8, 0.4, 0.35]),
];
#[rustfmt::skip]
const DIFFUSE: [[f32; 2]; 20] = [
    [0.15915, 0.31831], [0.15248, 0.30495], [0.12229, 0.24457], [0.056486, 0.11297], [0.13892, 0.27784],
    [0.050052, 0.1001], [0.0096759, 0.019352], [0.10106, 0.20213], [0.083882, 0.16776], [0.036275, 0.07255],
    [0.14253, 0.28506], [0.080799, 0.1616], [0.0, 0.0], [0.0, 0.0], [0.0, 0.0],
    [0.0, 0.0], [0.0, 0.0], [0.0, 0.0], [0.0, 0.0], [0.0, 0.0],
];
#[rustfmt::skip]
const GGX_ANISOTROPIC_METAL: [[f32; 2]; 20] = [
    [0.49353, 0.79577], [0.50548, 0.81635], [0.53675, 0.88014], [1.1341, 1.8774], [0.010014, 0.016411],
    [0.0036081, 0.0063377], [0.41242, 1.0835], [0.08827, 0.14472], [0.19633, 0.36028], [0.0025683, 0.006736],
    [0.00784, 0.012709], [0.029368, 0.051888], [0.0, 0.0], [0.0, 0.0], [0.0, 0.0],
    [0.0, 0.0], [0.0, 0.0], [0.0, 0.0], [0.0, 0.0], [0.0, 0.0],
];
#[rustfmt::skip]
const BECKMANN_METAL: [[f32; 2]; 20] = [
    [0.54836, 0.88419], [0.57777, 0.93167], [0.67812, 1.0941], [1.4514, 2.236], [1.9249e-05, 3.1047e-05],
    [6.9351e-06, 1.1344e-05], [0.0011308, 0.0025546], [0.051811, 0.083558], [0.59636, 0.95944], [4.1586e-07, 7.1234e-07],
    [7.2732e-06, 1.1732e-05], [0.036102, 0.058235], [0.0, 0.0], [0.0, 0.0], [0.0, 0.0],
    [0.0, 0.0], [0.0, 0.0], [0.0, 0.0], [0.0, 0.0], [0.0, 0.0],
];
#[rustfmt::skip]
const GGX_GLASS: [[f32; 2]; 20] = [
    [0.019894, 0.019894], [0.020857, 0.020931], [0.026575, 0.027293], [0.13891, 0.17035], [0.0034377, 0.0034802],
    [0.0012386, 0.0015902], [0.032784, 0.12528], [0.0079497, 0.0083954], [0.030258, 0.033132], [0.0018623, 0.0027747],
    [0.0036613, 0.0036971], [0.0039558, 0.0043685], [6.2291, 14.05], [3.8824, 8.8169], [0.36815, 0.8475],
    [0.05341, 0.12114], [0.020733, 0.020784], [0.62543, 0.64497], [13.001, 5.83], [0.55206, 0.29811],
];
#[rustfmt::skip]
const BECKMANN_GLASS: [[f32; 2]; 20] = [
    [0.017736, 0.017736], [0.019073, 0.019073], [0.064893, 0.064893], [2.2245, 2.236], [7.5539e-07, 7.5539e-07],
    [2.7216e-07, 2.76e-07], [0.0013155, 0.0025546], [0.017491, 0.017491], [0.95944, 0.95944], [6.6992e-07, 7.1234e-07],
    [2.9237e-07, 2.9237e-07], [0.0015322, 0.0015322], [0.33267, 0.18806], [0.0, 0.0], [0.0, 0.0],
    [2.0765e-07, 1.1739e-07], [0.018424, 0.018424], [0.029927, 0.029927], [0.0063207, 0.011181], [0.0, 0.0],
];
#[rustfmt::skip]
const PLASTIC: [[f32; 2]; 20] = [
    [0.19402, 0.30156], [0.18581, 0.28881], [0.14707, 0.22937], [0.050497, 0.085508], [0.14197, 0.2103],
    [0.051149, 0.09466], [0.00093242, 0.0038657], [0.11684, 0.18332], [0.096143, 0.15523], [0.031515, 0.066031],
    [0.13398, 0.19442], [0.093703, 0.15309], [0.0, 0.0], [0.0, 0.0], [0.0, 0.0],
    [0.0, 0.0], [0.0, 0.0], [0.0, 0.0], [0.0, 0.0], [0.0, 0.0],
];
#[rustfmt::skip]
const NONLINEAR_PLASTIC: [[f32; 2]; 20] = [
    [0.079746, 0.2703], [0.076362, 0.25882], [0.060245, 0.2046], [0.020417, 0.072975], [0.057858, 0.17947],
    [0.020845, 0.084759], [0.00040058, 0.0030924], [0.04759, 0.16169], [0.039137, 0.13777], [0.012826, 0.058297],
    [0.054708, 0.16402], [0.038264, 0.13722], [0.0, 0.0], [0.0, 0.0], [0.0, 0.0],
    [0.0, 0.0], [0.0, 0.0], [0.0, 0.0], [0.0, 0.0], [0.0, 0.0],
];
#[rustfmt::skip]
const BECKMANN_PLASTIC: [[f32; 2]; 20] = [
    [0.464, 0.88798], [0.4571, 0.877], [0.31013, 0.6045], [0.47313, 0.8855], [0.11423, 0.18856],
    [0.041156, 0.09235], [0.0020997, 0.0055287], [0.093637, 0.1752], [0.094632, 0.17956], [0.025702, 0.063207],
    [0.10865, 0.17075], [0.075156, 0.14955], [0.0, 0.0], [0.0, 0.0], [0.0, 0.0],
    [0.0, 0.0], [0.0, 0.0], [0.0, 0.0], [0.0, 0.0], [0.0, 0.0],
];
#[rustfmt::skip]
const GGX_PLASTIC: [[f32; 2]; 20] = [
    [0.13841, 0.33113], [0.13394, 0.32114], [0.11359, 0.27771], [0.14493, 0.28372], [0.088403, 0.23974],
    [0.031851, 0.095129], [0.026789, 0.076437], [0.073492, 0.19694], [0.08434, 0.20565], [0.021841, 0.069395],
    [0.088252, 0.2419], [0.058222, 0.1575], [0.0, 0.0], [0.0, 0.0], [0.0, 0.0],
    [0.0, 0.0], [0.0, 0.0], [0.0, 0.0], [0.0, 0.0], [0.0, 0.0],
];
#[rustfmt::skip]
const TWOSIDED: [[f32; 2]; 20] = [
    [0.063662, 0.31831], [0.060991, 0.30495], [0.048915, 0.24457], [0.022595, 0.11297], [0.055569, 0.27784],
    [0.020021, 0.1001], [0.0038704, 0.019352], [0.040425, 0.20213], [0.033553, 0.16776], [0.01451, 0.07255],
    [0.057011, 0.28506], [0.032319, 0.1616], [0.0, 0.0], [0.0, 0.0], [0.0, 0.0],
    [0.0, 0.0], [0.46076, 0.74391], [0.64201, 1.05], [0.0, 0.0], [0.0, 0.0],
];
#[rustfmt::skip]
const BLEND: [[f32; 2]; 20] = [
    [0.20907, 0.48808], [0.21397, 0.49021], [0.21341, 0.46472], [0.287, 0.55177], [0.049556, 0.2118],
    [0.017854, 0.077347], [0.016365, 0.061414], [0.051493, 0.1801], [0.14719, 0.32748], [0.014375, 0.059705],
    [0.05139, 0.21816], [0.037062, 0.13783], [0.0, 0.0], [0.0, 0.0], [0.0, 0.0],
    [0.0, 0.0], [0.0, 0.0], [0.0, 0.0], [0.0, 0.0], [0.0, 0.0],
];
#[rustfmt::skip]
const MASK: [[f32; 2]; 20] = [
    [0.047746, 0.095493], [0.045743, 0.091486], [0.036686, 0.073372], [0.016946, 0.033892], [0.041677, 0.083353],
    [0.015016, 0.030031], [0.0029028, 0.0058055], [0.030319, 0.060638], [0.025165, 0.050329], [0.010882, 0.021765],
    [0.042759, 0.085517], [0.02424, 0.048479], [0.0, 0.0], [0.0, 0.0], [0.0, 0.0],
    [0.0, 0.0], [0.0, 0.0], [0.0, 0.0], [0.0, 0.0], [0.0, 0.0],
];
#[rustfmt::skip]
const NORMAL_MAP: [[f32; 2]; 20] = [
    [0.0082167, 0.014267], [0.0057689, 0.011419], [0.0, 0.0], [0.0, 0.0], [0.15943, 0.27918],
    [0.21258, 0.3744], [0.0, 0.0], [0.0011244, 0.0037829], [0.018047, 0.041157], [0.075466, 0.15881],
    [0.15349, 0.25293], [0.0, 0.0], [0.0, 0.0], [0.0, 0.0], [0.0, 0.0],
    [0.0, 0.0], [0.0, 0.0], [0.0, 0.0], [0.0, 0.0], [0.0, 0.0],
];
#[rustfmt::skip]
const BUMP_MAP: [[f32; 2]; 20] = [
    [0.15528, 0.31063], [0.15816, 0.3167], [0.12622, 0.25443], [0.075649, 0.16876], [0.12001, 0.24045],
    [0.020541, 0.041716], [0.0, 0.0], [0.080337, 0.16116], [0.059754, 0.12166], [0.044481, 0.091409],
    [0.14521, 0.29132], [0.10648, 0.21716], [0.0, 0.0], [0.0, 0.0], [0.0, 0.0],
    [0.0, 0.0], [0.0, 0.0], [0.0, 0.0], [0.0, 0.0], [0.0, 0.0],
];
#[rustfmt::skip]
const TWOSIDED_NORMAL_MAP: [[f32; 2]; 20] = [
    [0.0082167, 0.014267], [0.0057689, 0.011419], [0.0, 0.0], [0.0, 0.0], [0.15943, 0.27918],
    [0.21258, 0.3744], [0.0, 0.0], [0.0011244, 0.0037829], [0.018047, 0.041157], [0.075466, 0.15881],
    [0.15349, 0.25293], [0.0, 0.0], [0.0, 0.0], [0.0, 0.0], [0.0, 0.0],
    [0.0, 0.0], [0.013296, 0.021926], [0.0096605, 0.020508], [0.0, 0.0], [0.0, 0.0],
];
#[rustfmt::skip]
const TWOSIDED_BUMP_MAP: [[f32; 2]; 20] = [
    [0.25524, 0.41212], [0.25783, 0.41635], [0.20938, 0.34476], [0.99215, 1.7887], [0.032608, 0.053566],
    [0.0055811, 0.015905], [0.0, 0.0], [0.031843, 0.054676], [0.09722, 0.17796], [0.015076, 0.030129],
    [0.047631, 0.077401], [0.17467, 0.29455], [0.0, 0.0], [0.0, 0.0], [0.0, 0.0],
    [0.0, 0.0], [0.043191, 0.069907], [0.10124, 0.1638], [0.0, 0.0], [0.0, 0.0],
];
