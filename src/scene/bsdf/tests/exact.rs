//! Reciprocity, adjoint, extreme arguments, nesting: what holds for every single direction.

use super::*;

/// f(wo, wi) / n(wo)^2 = f(wi, wo) / n(wi)^2, n being the index on the side of a direction (Veach 1997, section 5.2).
#[test]
fn scattering_is_reciprocal() {
    let mut compared = 0;
    for (name, materials) in cases() {
        let interior = match &materials[0] {
            Material::RoughDielectric { eta, .. } => *eta,
            _ => 1.0,
        };
        let index = |w: Vec3| if w.z > 0.0 { 1.0 } else { interior };
        for i in 0..300 {
            let direction = |d: u64| {
                let z = 2.0 * uniform(3, i, d) - 1.0;
                let (sin, cos) = (std::f32::consts::TAU * uniform(3, i, d + 1)).sin_cos();
                let r = (1.0 - z * z).sqrt();
                Vec3::new(r * cos, r * sin, z)
            };
            let (a, b) = (direction(0), direction(2));
            let f = |wo: Vec3, wi: Vec3| {
                let f = resolve(&materials, &flat(), wo).eval(wo, wi, Transport::Radiance);
                f.y / wi.z.abs() / (index(wo) * index(wo))
            };
            let (x, y) = (f(a, b), f(b, a));
            assert!((x - y).abs() <= 1e-3 * x.abs() + 1e-6, "{name} {a} {b}: {x} {y}");
            compared += usize::from(x > 0.0);
        }
    }
    assert!(compared > 1000, "{compared}");
}

/// eval(a, b, Radiance) / |b.n_geo| = eval(b, a, Importance) / |a.n_geo|: the two transports describe the same light,
/// with shading normals, refraction and maps of normals.
#[test]
fn importance_is_the_adjoint_of_radiance() {
    let mut all = cases();
    all.push(("bump map", vec![metal(rough(Ggx, 0.4, 0.4)), Material::BumpMap { texture: 0, scale: 0.1, nested: 0 }]));
    let at = tilted();
    let mut compared = 0;
    for (name, materials) in all {
        for a in views() {
            let bsdf = resolve(&materials, &at, a);
            for i in 0..50 {
                let Some(s) = draw(&bsdf, a, 9, i, Transport::Radiance).filter(|s| s.pdf_dir > 0.0) else {
                    continue;
                };
                let b = s.wi;
                let x = bsdf.eval(a, b, Transport::Radiance).y / b.dot(at.n_geo).abs();
                let back = resolve(&materials, &at, b);
                let y = back.eval(b, a, Transport::Importance).y / a.dot(at.n_geo).abs();
                assert!((x - y).abs() <= 2e-3 * x.abs() + 1e-6, "{name} {a} {b}: {x} {y}");
                compared += 1;
            }
        }
    }
    assert!(compared > 2000, "{compared}");
}

#[test]
fn dirac_samples_carry_the_adjoint_factors() {
    let smooth = Material::Dielectric { eta: 1.5, specular_reflectance: grey(1.0), specular_transmittance: grey(1.0) };
    let at = tilted();
    let wo = Vec3::new(0.4, 0.1, 0.8).normalize();
    let bsdf = resolve(&[smooth], &at, wo);
    for u in [0.0, 0.9999] {
        let of = |t| bsdf.sample(wo, u, Vec2::splat(0.5), t).expect("glass always scatters");
        let (radiance, importance) = (of(Transport::Radiance), of(Transport::Importance));
        let cos = |w: Vec3, n: Vec3| w.dot(n).abs();
        let s = radiance.wi;
        let veach = cos(wo, at.n_shade) * cos(s, at.n_geo) / (cos(wo, at.n_geo) * cos(s, at.n_shade));
        let expected = veach * radiance.eta * radiance.eta;
        let ratio = importance.weight.y / radiance.weight.y;
        assert!((ratio - expected).abs() < 1e-4, "{ratio} {expected}");
    }
}

#[test]
fn extreme_arguments_give_finite_values_or_nothing() {
    let one = 1.0 - f32::EPSILON / 2.0;
    let mut all = cases();
    for alpha in [0.0, 1e-4, 1e-2, 1.0, f32::NAN, f32::INFINITY] {
        for d in [Beckmann, Ggx] {
            let r = || rough(d, alpha, 0.1);
            all.push(("metal", vec![metal(r())]));
            all.push(("glass", vec![glass(1.5, r())]));
            all.push(("bent glass", vec![glass(0.01, r())]));
            all.push(("glass that does not bend", vec![glass(1.0, r())]));
            all.push(("plastic", vec![plastic(1.5, 1.0, 1.0, true, Some(r()))]));
        }
    }
    all.push(("brighter than white", vec![plastic(1.5, 50.0, 2.0, true, None)]));
    all.push(("no colour", vec![diffuse(f32::NAN)]));
    let mut views = views();
    for z in [0.0, -0.0, 1e-8, -1e-8, 1e-4, -1e-4, 1.0, -1.0f32] {
        let r = (1.0 - z * z).sqrt();
        views.push(Vec3::new(r, 0.0, z));
        views.push(Vec3::new(-0.6 * r, 0.8 * r, z));
    }
    for (name, materials) in &all {
        for at in [flat(), tilted()] {
            for &wo in &views {
                let bsdf = resolve(materials, &at, wo);
                assert!(bsdf.albedo(wo).is_finite());
                for transport in [Transport::Radiance, Transport::Importance] {
                    for &wi in &views {
                        let (f, pdf) = bsdf.eval_pdf(wo, wi, transport);
                        assert!(f.is_finite() && f.min_element() >= 0.0, "{name} {wo} {wi}: {f}");
                        assert!(pdf.is_finite() && pdf >= 0.0, "{name} {wo} {wi}: {pdf}");
                    }
                    for u in [[0.0, 0.0], [one, one], [0.0, one], [one, 0.0], [0.5, 0.5]] {
                        for u_lobe in [0.0, 0.5, one] {
                            let Some(s) = bsdf.sample(wo, u_lobe, u.into(), transport) else {
                                continue;
                            };
                            assert!(s.weight.is_finite() && s.weight.min_element() >= 0.0);
                            assert!((s.wi.length() - 1.0).abs() < 1e-3, "{name} {wo} {u:?}: {}", s.wi);
                            assert!(s.pdf_dir.is_finite() && s.eta > 0.0);
                        }
                    }
                }
            }
        }
    }
}

#[test]
fn nesting_keeps_the_weights() {
    let wo = Vec3::new(0.3, 0.2, 0.9).normalize();
    let (r, t) = (Transport::Radiance, Transport::Importance);
    // Sixteen diffuse leaves, more than there is place for: all alike, so nothing may be lost.
    let mut deep = vec![diffuse(0.5)];
    for i in 0..40 {
        deep.push(Material::Blend { weight: Scalar::Constant(0.5), first: i, second: i, absorbed: 0.0 });
    }
    let bsdf = resolve(&deep, &flat(), wo);
    let single = resolve(&deep[..1], &flat(), wo);
    assert_eq!(bsdf.layers().count(), MAX_LAYERS);
    assert!((bsdf.eval(wo, wo, r) - single.eval(wo, wo, r)).length() < 1e-6);
    // A mixture that loses a quarter.
    let lossy = Material::Blend { weight: Scalar::Constant(0.3), first: 0, second: 0, absorbed: 0.25 };
    let bsdf = resolve(&[diffuse(0.8), lossy], &flat(), wo);
    assert!((bsdf.albedo(wo).x - 0.6).abs() < 1e-6);
    // Null passes with its share of the weight.
    let mask = Material::Mask { opacity: Scalar::Constant(0.25), nested: 0 };
    let bsdf = resolve(&[diffuse(0.5), mask], &flat(), wo);
    let passed: f32 = (0..10_000)
        .filter_map(|i| draw(&bsdf, wo, 2, i, t))
        .filter(|s| s.lobe == LobeKind::Null)
        .map(|s| {
            assert_eq!((s.wi, s.eta, s.pdf_dir), (-wo, 1.0, 0.0));
            s.weight.x
        })
        .sum();
    assert!((passed / 10_000.0 - 0.75).abs() < 0.02, "{passed}");
    assert!(!bsdf.is_delta() && bsdf.has_diffuse() && bsdf.min_alpha() == 1.0);
    // Nothing at all.
    let gone = Material::Blend { weight: Scalar::Constant(0.5), first: 0, second: 0, absorbed: 1.0 };
    let bsdf = resolve(&[diffuse(0.5), gone], &flat(), wo);
    assert!(bsdf.sample(wo, 0.5, Vec2::splat(0.5), r).is_none() && bsdf.albedo(wo) == Rgb::ZERO);
}

#[test]
fn lobes_are_classified() {
    let smooth = Material::Conductor {
        eta: Color::Constant(Rgb::ZERO),
        k: Color::Constant(Rgb::ONE),
        specular_reflectance: grey(1.0),
    };
    let wo = Vec3::new(0.3, 0.2, 0.9).normalize();
    let of = |m: Material| {
        let b = resolve(&[m], &flat(), wo);
        (b.is_delta(), b.has_diffuse(), b.min_alpha())
    };
    assert_eq!(of(smooth), (true, false, 0.0));
    assert_eq!(of(Material::Null), (true, false, 1.0));
    assert_eq!(of(diffuse(0.5)), (false, true, 1.0));
    assert_eq!(of(metal(rough(Ggx, 0.2, 0.3))), (false, false, 0.2));
    assert_eq!(of(plastic(1.5, 0.5, 1.0, false, None)), (false, true, 0.0));
    assert_eq!(of(plastic(1.5, 0.5, 1.0, false, Some(rough(Ggx, 0.2, 0.2)))), (false, true, 0.2));
}

/// The diffuse part and the rest add up to the whole, the diffuse part is all diffuse, and the rest never samples diffusely.
#[test]
fn parts_add_up() {
    let (mut diffuse_parts, mut rests) = (0, 0);
    for (name, materials) in cases() {
        for a in views() {
            let whole = resolve(&materials, &flat(), a);
            let (diffuse, rest) = whole.clone().split();
            let parts: Vec<&Bsdf> = diffuse.iter().chain(&rest).collect();
            let albedo: Rgb = parts.iter().map(|p| p.albedo(a)).sum();
            assert!((albedo - whole.albedo(a)).abs().max_element() < 1e-5, "{name} {a}: {albedo}");
            for i in 0..20 {
                let Some(b) = draw(&whole, a, 4, i, Transport::Radiance).map(|s| s.wi) else { continue };
                let f = whole.eval(a, b, Transport::Radiance);
                let sum: Rgb = parts.iter().map(|p| p.eval(a, b, Transport::Radiance)).sum();
                assert!((f - sum).abs().max_element() <= 1e-5 + 1e-4 * f.max_element(), "{name} {a} {b}: {f} {sum}");
                let kind = |p: &Bsdf| draw(p, a, 5, i, Transport::Radiance).map(|s| s.lobe);
                if let Some(d) = &diffuse {
                    diffuse_parts += 1;
                    assert!(matches!(kind(d), None | Some(LobeKind::Diffuse)), "{name}");
                    assert_eq!(d.min_alpha(), 1.0, "{name}");
                }
                if let Some(r) = &rest {
                    rests += 1;
                    assert_ne!(kind(r), Some(LobeKind::Diffuse), "{name}");
                    assert!(!r.has_diffuse(), "{name}");
                }
            }
        }
    }
    assert!(diffuse_parts > 100 && rests > 100, "{diffuse_parts} {rests}");
}

/// The branches of a smooth material are what its samples have on average.
#[test]
fn branches_are_the_mean_of_the_samples() {
    let glass =
        |tint| Material::Dielectric { eta: 1.5, specular_reflectance: grey(1.0), specular_transmittance: grey(tint) };
    let mut seen = [0; 3];
    for materials in [vec![glass(1.0)], vec![glass(0.3)], vec![Material::Null]] {
        for wo in views() {
            let bsdf = resolve(&materials, &flat(), wo);
            let branches = bsdf.branches(wo, Transport::Radiance).expect("a single Dirac lobe");
            seen[branches.len()] += 1;
            let n = 20_000;
            let mut sums = [0.0f64; 2];
            for i in 0..n {
                let u = (i as f32 + 0.5) / n as f32;
                let s = bsdf.sample(wo, u, Vec2::splat(0.5), Transport::Radiance).expect("it scatters");
                let k = branches.iter().position(|b| b.wi == s.wi).expect("a known direction");
                sums[k] += f64::from(s.weight.y) / f64::from(n);
            }
            for (b, sum) in branches.iter().zip(sums) {
                assert!((f64::from(b.weight.y) - sum).abs() < 1e-3, "{materials:?} {wo}: {} {sum}", b.weight.y);
            }
        }
    }
    assert!(seen[1] > 0 && seen[2] > 0, "{seen:?}");
    let rough = resolve(&[metal(rough(Ggx, 0.4, 0.4))], &flat(), Vec3::Z);
    assert!(rough.branches(Vec3::Z, Transport::Radiance).is_none());
}
