//! Eight lights and eight groups at a time against one at a time.

use super::setting::{Setting, random};
use super::*;
use crate::transport::eight::Eight;
use crate::transport::vpl_tree::groups::LEAF_GROUP;

#[test]
fn every_light_is_in_one_leaf_and_groups_hold_those_within() {
    for n in [1, 2, 8, 9, 70, 3000] {
        let setting = Setting::new(n, 8);
        let groups = setting.tree.groups();
        let mut seen = vec![0; n as usize];
        let mut asked = 1;
        for (index, node) in groups.nodes().iter().enumerate() {
            for lane in 0..WIDTH {
                let range = node.first[lane]..node.first[lane] + node.count[lane];
                assert_eq!(range.is_empty(), node.used >> lane & 1 == 0);
                if node.within[lane] == LEAF_GROUP {
                    range.for_each(|i| seen[i as usize] += 1);
                    continue;
                }
                let inner = &groups.nodes()[node.within[lane] as usize];
                assert!(node.within[lane] as usize > index);
                assert_eq!((inner.first[0], inner.count.iter().sum()), (range.start, node.count[lane]));
                asked += 1;
            }
        }
        assert!(seen.iter().all(|&k| k == 1), "{n}: {seen:?}");
        assert_eq!(asked, groups.nodes().len(), "{n}");
    }
}

#[test]
fn eight_contributions_are_those_of_single_lights() {
    let setting = Setting::new(400, 9);
    let mut vpls = Vpls::from_lights(setting.vpls.lights.clone());
    for (i, light) in vpls.lights.iter_mut().enumerate() {
        let u = |k| random(i as u64, k) - 0.5;
        light.n_shade = (light.n + 0.6 * Vec3::new(u(20), u(21), u(22))).normalize();
        light.segments = 1 + i as u32 % 5;
        if i % 9 == 4 {
            *light = Vpl::isotropic(light.p, light.power);
        }
    }
    // At the point itself: nothing, and no NaN.
    vpls.lights[17].p = setting.at.p;
    let (mut lit, mut dark, mut isotropic) = (0, 0, 0);
    for segments in [[0, u32::MAX], [2, 4]] {
        let r = Receiver::new(&setting.at, &setting.bsdf, Vec3::Y, Rgb::new(0.5, 1.0, 0.8), segments, 1);
        for first in (0..400u32).step_by(8) {
            let indices = std::array::from_fn(|k| (first + 3 * k as u32) % 400);
            let t = r.tentative_eight::<Eight>(&vpls, &indices);
            for (k, &i) in indices.iter().enumerate() {
                let light = &vpls.lights[i as usize];
                let want = r.tentative(&vpls, light);
                let got = Rgb::from_array(t.map(|channel| channel[k / 4][k % 4]));
                assert!(close(got, want, 1e-6), "{i}: {got}, not {want}");
                lit += u32::from(want != Rgb::ZERO);
                dark += u32::from(want == Rgb::ZERO);
                isotropic += u32::from(want != Rgb::ZERO && light.is_isotropic());
            }
        }
    }
    assert!(lit > 200 && dark > 50 && isotropic > 20, "{lit} {dark} {isotropic}: the test sees nothing");
}

/// The vector units of this processor against four lanes at a time: the same bits. (Without AVX2 both are the same.)
#[test]
fn any_vector_units_give_the_same_sums() {
    let setting = Setting::new(3000, 10);
    let r = setting.receiver();
    let near = setting.cache.neighbours(r.at.p, r.normal());
    let mut sums = Vec::new();
    for lambda in [1e-7, 1e-4, 1e-2] {
        let many = setting.many(Strategy::Joint, lambda);
        for i in 0..50 {
            let coins = [1, 2].map(|k| Systematic::new(f64::from(unit_f32(hash(i, k)))));
            let (mut a, mut b) = (Tally::default(), Tally::default());
            let [mut select, mut check] = coins.clone();
            let wide = many.joint(&r, &near, &mut select, &mut check, &mut a);
            let [mut select, mut check] = coins;
            let narrow = many.joint_by::<_, Eight>(&r, &near, &mut select, &mut check, &mut b);
            assert_eq!(wide.to_array().map(f32::to_bits), narrow.to_array().map(f32::to_bits), "{lambda} {i}");
            assert_eq!(a.counts(), b.counts());
            sums.push(wide.x.to_bits());
        }
    }
    sums.sort_unstable();
    sums.dedup();
    assert!(sums.len() > 100, "only {} sums differ: the comparison tells little", sums.len());
}
