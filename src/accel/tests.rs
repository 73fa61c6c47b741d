//! Queries against brute force in f64, and the two kernels against each other.

use super::*;
use crate::math::DVec3;
use crate::math::sampler::{hash, unit_f32};
use crate::scene::shape::{Cylinder, Disk, Rectangle, Sphere};
use crate::scene::{Geometry, Mesh};

/// Plain random numbers, keyed by a counter.
pub(super) struct Random(pub u64);

impl Random {
    pub fn unit(&mut self) -> f32 {
        self.0 += 1;
        unit_f32(hash(0x5eed, self.0))
    }

    /// Uniform in the cube `[-1,1]^3`.
    pub fn cube(&mut self) -> Vec3 {
        Vec3::new(self.unit(), self.unit(), self.unit()) * 2.0 - Vec3::ONE
    }
}

pub(super) fn shape(geometry: Geometry) -> Shape {
    Shape { name: String::new(), geometry, material: 0, emission: None }
}

pub(super) fn mesh(positions: Vec<Vec3>, triangles: Vec<[u32; 3]>) -> Shape {
    shape(Geometry::Mesh(Mesh {
        positions,
        normals: Vec::new(),
        uvs: Vec::new(),
        triangles,
        edges: Vec::new(),
        neighbors: Vec::new(),
    }))
}

/// `count` separate triangles of size up to `size` in the cube `[-1,1]^3`.
pub(super) fn soup(random: &mut Random, count: u32, size: f32) -> Shape {
    let mut positions = Vec::new();
    for _ in 0..count {
        let a = random.cube();
        positions.extend([a, a + random.cube() * size, a + random.cube() * size]);
    }
    mesh(positions, (0..count).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect())
}

/// All kinds of shapes in the cube `[-1,1]^3`, a bit over 300 primitives.
fn mixed(random: &mut Random) -> Vec<Shape> {
    let mut shapes = vec![soup(random, 200, 0.3)];
    for i in 0..100 {
        let center = random.cube();
        let (ex, other) = (random.cube() * 0.2, random.cube() * 0.2);
        let n = ex.cross(other).normalize();
        shapes.push(shape(match i % 4 {
            0 => Geometry::Sphere(Sphere {
                center,
                radius: 0.02 + 0.2 * random.unit(),
                flip: i % 8 == 0,
                axes: [Vec3::X, Vec3::Y, Vec3::Z],
            }),
            1 => Geometry::Rectangle(Rectangle { center, ex, ey: other, n }),
            2 => Geometry::Disk(Disk { center, ex, ey: other, n }),
            _ => {
                let reference = other.any_orthonormal_vector();
                Geometry::Cylinder(Cylinder {
                    p0: center,
                    axis: other * 2.0,
                    radius: 0.02 + 0.1 * random.unit(),
                    flip: false,
                    reference,
                    binormal: other.normalize().cross(reference),
                })
            }
        }));
    }
    shapes
}

/// Smallest root of |f + t d|^2 = r^2 above tmin for which `accept` holds.
fn quadratic(f: DVec3, d: DVec3, r: f64, tmin: f64, accept: impl Fn(f64) -> bool) -> Option<f64> {
    let (a, b, c) = (d.dot(d), f.dot(d), f.dot(f) - r * r);
    let root = (b * b - a * c).sqrt();
    [(-b - root) / a, (-b + root) / a].into_iter().find(|&t| t >= tmin && accept(t))
}

/// Textbook Moeller-Trumbore in f64.
fn triangle(o: DVec3, d: DVec3, [a, b, c]: [Vec3; 3], tmin: f64) -> Option<f64> {
    let (a, e1, e2) = (a.as_dvec3(), (b - a).as_dvec3(), (c - a).as_dvec3());
    let p = d.cross(e2);
    let det = e1.dot(p);
    let (s, inv) = (o - a, 1.0 / det);
    let (u, q) = (s.dot(p) * inv, s.cross(e1));
    let (v, t) = (d.dot(q) * inv, e2.dot(q) * inv);
    (u >= 0.0 && v >= 0.0 && u + v <= 1.0 && t >= tmin).then_some(t)
}

/// Nearest hit (t, shape, prim) by testing everything, with formulas that share nothing with the tree's.
pub(super) fn brute_force(shapes: &[Shape], ray: &Ray) -> Option<(f64, u32, u32)> {
    let (o, d, tmin) = (ray.o.as_dvec3(), ray.d.as_dvec3(), ray.tmin as f64);
    let mut best: Option<(f64, u32, u32)> = None;
    let mut consider = |t: Option<f64>, shape: usize, prim: usize| {
        if let Some(t) = t.filter(|&t| t <= ray.tmax as f64 && best.is_none_or(|b| t < b.0)) {
            best = Some((t, shape as u32, prim as u32));
        }
    };
    for (i, s) in shapes.iter().enumerate() {
        match &s.geometry {
            Geometry::Mesh(m) => {
                for (j, t) in m.triangles.iter().enumerate() {
                    consider(triangle(o, d, t.map(|v| m.positions[v as usize]), tmin), i, j);
                }
            }
            Geometry::Rectangle(r) => {
                let (a, b) = (r.center - r.ex - r.ey, r.center + r.ex + r.ey);
                consider(triangle(o, d, [a, r.center + r.ex - r.ey, b], tmin), i, 0);
                consider(triangle(o, d, [a, b, r.center - r.ex + r.ey], tmin), i, 0);
            }
            Geometry::Sphere(s) => {
                consider(quadratic(o - s.center.as_dvec3(), d, s.radius as f64, tmin, |_| true), i, 0);
            }
            Geometry::Disk(k) => {
                let (ex, ey, c) = (k.ex.as_dvec3(), k.ey.as_dvec3(), k.center.as_dvec3());
                // o + t d = c + x ex + y ey by Cramer's rule.
                let det = d.dot(ex.cross(ey));
                let t = (c - o).dot(ex.cross(ey)) / det;
                let p = o + t * d - c;
                let n = ex.cross(ey).normalize();
                let (x, y) = (p.cross(ey).dot(n), ex.cross(p).dot(n));
                let area = ex.cross(ey).length();
                consider((x * x + y * y <= area * area && t >= tmin).then_some(t), i, 0);
            }
            Geometry::Cylinder(c) => {
                let (p0, axis) = (c.p0.as_dvec3(), c.axis.as_dvec3());
                let flat = |v: DVec3| v - v.project_onto(axis);
                let on = |t: f64| (0.0..=1.0).contains(&((o + t * d - p0).dot(axis) / axis.length_squared()));
                consider(quadratic(flat(o - p0), flat(d), c.radius as f64, tmin, on), i, 0);
            }
        }
    }
    best
}

pub(super) fn random_ray(random: &mut Random) -> Ray {
    let (o, target) = (random.cube() * 2.0, random.cube());
    Ray { o, d: (target - o) * (0.1 + 3.0 * random.unit()), tmin: 0.0, tmax: f32::INFINITY }
}

/// Compares with brute force. Rays that pass an edge within rounding may differ: fewer than 1 in 2000.
fn agrees_with_brute_force(shapes: &[Shape], rays: impl Iterator<Item = Ray>) -> (usize, usize) {
    let accel = Accel::new(shapes);
    let (mut hits, mut total, mut differ) = (0, 0, 0);
    for ray in rays {
        total += 1;
        let found = accel.closest(&ray);
        assert_eq!(found.is_some(), accel.occluded(&ray), "{ray:?}");
        hits += found.is_some() as usize;
        let same = match (found, brute_force(shapes, &ray)) {
            (None, None) => true,
            (Some(h), Some((t, shape, prim))) => {
                (h.shape, h.prim) == (shape, prim) && (h.t as f64 - t).abs() <= 1e-5 * (t + ray.o.length() as f64)
            }
            _ => false,
        };
        differ += !same as usize;
    }
    assert!(differ * 2000 <= total, "{differ} of {total} differ");
    (hits, total)
}

#[test]
fn mixed_scenes_agree_with_brute_force() {
    let mut random = Random(1);
    for _ in 0..4 {
        let shapes = mixed(&mut random);
        let rays: Vec<Ray> = (0..8000).map(|_| random_ray(&mut random)).collect();
        let (hits, total) = agrees_with_brute_force(&shapes, rays.into_iter());
        assert!(hits * 4 > total && hits < total, "{hits} of {total}: rays that test something");
    }
}

#[test]
fn segments_are_respected() {
    let mut random = Random(2);
    let shapes = mixed(&mut random);
    let rays: Vec<Ray> = (0..8000)
        .map(|_| {
            let (tmin, length) = (random.unit() * 0.5, random.unit());
            Ray { tmin, tmax: tmin + length, ..random_ray(&mut random) }
        })
        .collect();
    agrees_with_brute_force(&shapes, rays.into_iter());
}

#[test]
fn axis_parallel_rays_agree_with_brute_force() {
    let mut random = Random(3);
    let shapes = mixed(&mut random);
    let rays: Vec<Ray> = (0..6000)
        .map(|i| {
            let mut d = [0.0, -0.0, 0.0];
            d[i % 3] = if i % 2 == 0 { 1.0 } else { -0.5 };
            let d = Vec3::from(d);
            Ray { d, o: random.cube() - d.signum() * d.abs() * 2.0, tmin: 0.0, tmax: f32::INFINITY }
        })
        .collect();
    agrees_with_brute_force(&shapes, rays.into_iter());
}

#[test]
fn both_kernels_give_the_same_bits() {
    let mut random = Random(4);
    let mut shapes = mixed(&mut random);
    shapes.push(soup(&mut random, 2000, 0.1));
    // Duplicates: every hit on this mesh is a tie.
    shapes.push(shapes[0].clone());
    let fast = Accel::new(&shapes);
    let portable = Accel::with_simd(&shapes, Simd::Portable);
    assert_eq!(portable.simd(), Simd::Portable);
    let bits = |h: Option<Hit>| h.map(|h| (h.t.to_bits(), h.u.to_bits(), h.v.to_bits(), h.shape, h.prim));
    for i in 0..100_000 {
        let mut ray = random_ray(&mut random);
        if i % 5 == 0 {
            ray.d[i / 5 % 3] = 0.0;
        }
        ray.tmax = if i % 2 == 0 { f32::INFINITY } else { random.unit() };
        assert_eq!(bits(fast.closest(&ray)), bits(portable.closest(&ray)), "{ray:?}");
        assert_eq!(fast.occluded(&ray), portable.occluded(&ray), "{ray:?}");
    }
}

#[test]
fn the_lower_primitive_wins_a_tie() {
    let mut random = Random(5);
    let one = soup(&mut random, 300, 0.5);
    let shapes = vec![one.clone(), one.clone(), one];
    let accel = Accel::new(&shapes);
    let hits = (0..5000).filter_map(|_| accel.closest(&random_ray(&mut random))).collect::<Vec<_>>();
    assert!(hits.len() > 500 && hits.iter().all(|h| h.shape == 0));
}

#[test]
fn barycentrics_give_the_hit_point() {
    let mut random = Random(6);
    let shapes = vec![soup(&mut random, 300, 0.5)];
    let Geometry::Mesh(m) = &shapes[0].geometry else { unreachable!() };
    let accel = Accel::new(&shapes);
    let mut hits = 0;
    for _ in 0..5000 {
        let ray = random_ray(&mut random);
        if let Some(h) = accel.closest(&ray) {
            let [a, b, c] = m.triangles[h.prim as usize].map(|v| m.positions[v as usize]);
            let p = a * (1.0 - h.u - h.v) + b * h.u + c * h.v;
            // Slivers and grazing rays lose digits.
            hits += (p.distance(ray.o + ray.d * h.t) < 1e-4) as usize;
            assert!(p.distance(ray.o + ray.d * h.t) < 1e-2);
        }
    }
    assert!(hits > 500);
}

/// Boxes that all overlap: walks need more than the short stack. And trees that are balanced by force.
#[test]
fn long_stacks_and_balanced_trees_find_the_same() {
    let mut random = Random(12);
    let shapes = [soup(&mut random, 20_000, 1.5)];
    let accel = Accel::new(&shapes);
    assert!(accel.tree.stack_need > 40, "{}", accel.tree.stack_need);
    let balanced = |depth| Accel { tree: build::build_with(&shapes, depth), avx2: Avx2::detect() };
    let others = [balanced(0), balanced(3), Accel::with_simd(&shapes, Simd::Portable)];
    let mut compared = 0;
    for i in 0..400 {
        let mut ray = random_ray(&mut random);
        if i % 2 == 0 {
            // Beyond everything: the whole line is searched.
            ray = Ray { tmin: 1e-3, d: ray.d * 1e-4, ..ray };
        }
        let hit = accel.closest(&ray);
        assert!(others.iter().all(|a| a.closest(&ray) == hit && a.occluded(&ray) == hit.is_some()));
        if i < 100 {
            let truth = brute_force(&shapes, &ray);
            compared += (truth.map(|t| t.2) == hit.map(|h| h.prim)) as usize;
        }
    }
    assert!(compared >= 98, "{compared}");
}

#[test]
fn the_tree_does_not_depend_on_the_number_of_threads() {
    let shapes = [soup(&mut Random(13), 60_000, 0.02)];
    let build = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let tree = pool.install(|| build::build(&shapes));
        let bits = |n: &layout::Node8| (n.bounds.map(|row| row.map(f32::to_bits)), n.children);
        let nodes: Vec<_> = tree.nodes.iter().map(bits).collect();
        let prims: Vec<_> = tree.tris.iter().map(|t| t.prim).collect();
        (nodes, prims)
    };
    let one = build(1);
    assert!(one.0.len() > 1000);
    assert!(one == build(2) && one == build(7));
}
