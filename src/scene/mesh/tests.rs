//! Meshes: adjacency against brute force, normals, transforms.

use super::*;
use crate::math::sampler::{hash, unit_f32};
use EdgeClass::{Always, Never, Silhouette};

fn world(data: MeshData) -> Mesh {
    Mesh::new(data, &DMat4::IDENTITY, false).expect("a good mesh")
}

fn triangles(positions: &[[f32; 3]], triangles: &[[u32; 3]]) -> MeshData {
    MeshData {
        positions: positions.iter().map(|&p| p.into()).collect(),
        triangles: triangles.to_vec(),
        ..MeshData::default()
    }
}

/// Closed cube `[-1,1]^3`, outward, every face with four vertices of its own.
fn cube() -> MeshData {
    let mut data = MeshData::default();
    for axis in 0..3 {
        for side in [1.0f32, -1.0] {
            let unit = |k: usize| Vec3::from_array([0, 1, 2].map(|i| if i == (axis + k) % 3 { 1.0 } else { 0.0 }));
            let (n, u, v) = (unit(0) * side, unit(1), unit(2) * side);
            let first = data.positions.len() as u32;
            data.positions.extend([n - u - v, n + u - v, n + u + v, n - u + v]);
            data.triangles.extend([[first, first + 1, first + 2], [first, first + 2, first + 3]]);
        }
    }
    data
}

/// A sphere by latitude and longitude; the seam and poles have doubled vertices with different uv.
fn globe(rows: u32, columns: u32) -> MeshData {
    let mut data = MeshData::default();
    for j in 0..=rows {
        for i in 0..=columns {
            let (theta, phi) = (
                j as f64 / rows as f64 * std::f64::consts::PI,
                (i % columns) as f64 / columns as f64 * std::f64::consts::TAU,
            );
            let sin = if j == rows { 0.0 } else { theta.sin() };
            data.positions.push(DVec3::new(sin * phi.cos(), sin * phi.sin(), theta.cos()).as_vec3());
            data.uvs.push(Vec2::new(i as f32 / columns as f32, j as f32 / rows as f32));
        }
    }
    let at = |i: u32, j: u32| j * (columns + 1) + i;
    for j in 0..rows {
        for i in 0..columns {
            data.triangles.push([at(i, j), at(i, j + 1), at(i + 1, j + 1)]);
            data.triangles.push([at(i, j), at(i + 1, j + 1), at(i + 1, j)]);
        }
    }
    data
}

fn count(mesh: &Mesh, class: EdgeClass) -> usize {
    mesh.edges.iter().flatten().filter(|&&e| e == class).count()
}

#[test]
fn a_closed_cube_has_its_twelve_creases_and_no_diagonals_wherever_it_stands() {
    for (scale, offset) in [(1.0, 0.0), (1e-3, 0.0), (1e4, 3.0), (1.0, 100.0)] {
        for turn in 0..20 {
            let m = DMat4::from_translation(DVec3::new(1.0, 2.0, -0.5) * offset * scale)
                * DMat4::from_rotation_x(turn as f64 * 0.37)
                * DMat4::from_rotation_z(turn as f64)
                * DMat4::from_scale(DVec3::splat(scale));
            let data = MeshData { face_normals: true, ..cube() };
            let mesh = Mesh::new(data, &m, turn % 2 == 1).expect("cube");
            assert_eq!((count(&mesh, Always), count(&mesh, Never)), (24, 12), "{scale} {offset} {turn}");
            assert!(mesh.neighbors.iter().flatten().all(|&n| n < 12));
        }
    }
}

#[test]
fn a_smooth_closed_surface_has_silhouettes_only_even_across_uv_seams() {
    let mesh = world(globe(24, 48));
    // The two rows at the poles lose one triangle of each pair.
    assert_eq!(mesh.triangles.len(), 2 * 24 * 48 - 2 * 48);
    assert_eq!(count(&mesh, Always), 0, "no boundary at the seam");
    // Quads of a globe are planar; all other edges are silhouettes.
    assert_eq!(count(&mesh, Never), 2 * 48 * 22);
    assert_eq!(count(&mesh, Silhouette), 3 * mesh.triangles.len() - 2 * 48 * 22);
    // A coarse one is all creases.
    assert_eq!(count(&world(globe(5, 6)), Silhouette), 0);
    // Normals are those of the sphere, within the coarseness, and the seam's copies have a normal each.
    for (p, n) in mesh.positions.iter().zip(&mesh.normals).skip(49).take(24 * 49 - 49) {
        assert!(p.dot(*n) > 0.99, "{p} {n}");
    }
}

#[test]
fn open_branched_and_contradicting_edges_are_seen_from_everywhere() {
    let p = [[0., 0., 0.], [1., 0., 0.], [0., 1., 0.], [1., 1., 0.01], [0.5, 0.5, 1.0]];
    let open = world(triangles(&p, &[[0, 1, 2]]));
    assert_eq!((open.edges[0], open.neighbors[0]), ([Always; 3], [u32::MAX; 3]));
    assert_eq!(open.opposite_normal(0, 1), None);
    // Two faces, nearly flat, consistently wound.
    let pair = world(triangles(&p, &[[0, 1, 2], [2, 1, 3]]));
    assert_eq!(pair.edges, [[Always, Silhouette, Always], [Silhouette, Always, Always]]);
    assert_eq!(pair.neighbors, [[u32::MAX, 1, u32::MAX], [0, u32::MAX, u32::MAX]]);
    assert_eq!(pair.opposite_normal(0, 1), Some(pair.face_normal(1)));
    // Wound against each other.
    let against = world(triangles(&p, &[[0, 1, 2], [1, 2, 3]]));
    assert_eq!((against.edges[0][1], against.neighbors[0][1]), (Always, 1));
    // Three faces on one edge.
    let three = world(triangles(&p, &[[0, 1, 2], [2, 1, 3], [2, 1, 4]]));
    assert_eq!(count(&three, Always), 9);
    assert!(three.neighbors.iter().flatten().all(|&n| n == u32::MAX));
    // A face folded back onto its neighbour is a crease, though in one plane.
    let folded = world(triangles(&[[0., 0., 0.], [1., 0., 0.], [0., 1., 0.], [0.1, 0.2, 0.]], &[[0, 1, 2], [2, 1, 3]]));
    assert_eq!(folded.edges[0][1], Always);
    // -0 and +0 are one place.
    let zeros = triangles(
        &[[0., 0., 0.], [1., 0., 0.], [0., 1., 0.], [-0., 1., 0.], [1., -0., -0.], [1., 1., 0.]],
        &[[0, 1, 2], [3, 4, 5]],
    );
    assert_eq!(world(zeros).edges[0][1], Never);
}

#[test]
fn the_crease_angle_is_twenty_degrees() {
    let hinge = |degrees: f32| {
        let (s, c) = degrees.to_radians().sin_cos();
        let far = [-c, 0.0, s];
        world(triangles(&[[0., 0., 0.], [0., 1., 0.], [1., 0., 0.], far], &[[1, 0, 2], [0, 1, 3]])).edges[0][0]
    };
    assert_eq!((hinge(0.0), hinge(1.0), hinge(19.9), hinge(20.1)), (Never, Silhouette, Silhouette, Always));
    assert_eq!((hinge(-1.0), hinge(-21.0), hinge(170.0)), (Silhouette, Always, Always));
}

/// Brute force: compares every pair of edges by position.
fn connect_slowly(mesh: &Mesh) -> Vec<[u32; 3]> {
    let end = |t: usize, e: usize| mesh.positions[mesh.triangles[t][e % 3] as usize];
    let n = mesh.triangles.len();
    let across = |t: usize, e: usize| {
        let (a, b) = (end(t, e), end(t, e + 1));
        let same =
            |&(s, f): &(usize, usize)| (s, f) != (t, e) && [(a, b), (b, a)].contains(&(end(s, f), end(s, f + 1)));
        let mut others = (0..n).flat_map(|s| (0..3).map(move |f| (s, f))).filter(same);
        match (others.next(), others.next()) {
            (Some((s, _)), None) => s as u32,
            _ => u32::MAX,
        }
    };
    (0..n).map(|t| [across(t, 0), across(t, 1), across(t, 2)]).collect()
}

#[test]
fn neighbors_agree_with_brute_force_on_random_soup() {
    for seed in 0..30 {
        // Few positions and several copies of each, so that edges meet often, with all multiplicities.
        let random = |i: u64| hash(seed, i);
        let positions = (0..24).map(|i| {
            let q = random(1000 + i % 9);
            Vec3::new((q % 7) as f32, (q / 7 % 7) as f32, (q / 49 % 7) as f32)
        });
        let data = MeshData {
            positions: positions.collect(),
            triangles: (0..20).map(|t| [0, 1, 2].map(|k| (random(3 * t + k) % 24) as u32)).collect(),
            ..MeshData::default()
        };
        let mesh = world(data);
        assert_eq!(mesh.neighbors, connect_slowly(&mesh), "seed {seed}");
        for (t, (edges, neighbors)) in mesh.edges.iter().zip(&mesh.neighbors).enumerate() {
            for e in 0..3 {
                assert!(neighbors[e] != u32::MAX || edges[e] == Always);
                if neighbors[e] != u32::MAX {
                    let back = neighbors[e] as usize;
                    assert!((0..3).any(|f| mesh.neighbors[back][f] == t as u32 && mesh.edges[back][f] == edges[e]));
                }
            }
        }
    }
}

#[test]
fn computed_normals_agree_with_mitsuba_and_follow_the_winding_through_a_mirror() {
    let data = triangles(
        &[[0., 0., 0.], [2., 0., 0.5], [2., 3., 0.], [-0.5, 1., 1.], [1., 1., 2.]],
        &[[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]],
    );
    // Measured with Mitsuba 3.9.1: as it is, and under scale (-1, 2, 1).
    let plain = [
        [-0.24173261, -0.81415147, 0.52794206],
        [0.4804265, -0.5474102, 0.6852245],
        [0.42311823, 0.5261193, 0.73767835],
        [-0.54095846, -0.22120778, 0.81143767],
        [0.06679092, -0.03854823, 0.99702203],
    ];
    let mirrored = [
        [-0.3021389, 0.5942791, -0.7453485],
        [0.2598117, 0.49289078, -0.83039546],
        [0.32843998, -0.35543755, -0.875095],
        [-0.55320174, 0.07345546, -0.8298026],
        [0.10397471, 0.0248688, -0.99426895],
    ];
    let scale = DMat4::from_scale(DVec3::new(-1.0, 2.0, 1.0));
    for (m, want) in [(DMat4::IDENTITY, plain), (scale, mirrored)] {
        let mesh = Mesh::new(data.clone(), &m, false).expect("a good mesh");
        let flipped = Mesh::new(data.clone(), &m, true).expect("a good mesh");
        for ((n, f), want) in mesh.normals.iter().zip(&flipped.normals).zip(want) {
            assert!((*n - Vec3::from(want)).length() < 2e-6, "{n} {want:?}");
            assert_eq!(*f, -*n);
        }
        for t in 0..4 {
            assert!((mesh.face_normal(t) + flipped.face_normal(t)).length() < 1e-6);
            assert!(mesh.face_normal(t).dot(mesh.normals[4]) > 0.0);
        }
    }
}

#[test]
fn given_normals_say_which_side_is_outside() {
    // Measured with Mitsuba 3.9.1 by the side on which an area light on the mesh shines (a triangle wound +z).
    let up = |normals: Option<f32>, face_normals: bool, mirror: bool, flip: bool| {
        let mut data = triangles(&[[0., 0., 0.], [1., 0., 0.], [0., 1., 0.]], &[[0, 1, 2]]);
        data.face_normals = face_normals;
        data.normals = normals.map_or(vec![], |z| vec![Vec3::new(0.0, 0.0, 3.0 * z); 3]);
        let m = DMat4::from_scale(DVec3::new(if mirror { -1.0 } else { 1.0 }, 1.0, 2.0));
        let mesh = Mesh::new(data, &m, flip).expect("a triangle");
        assert_eq!(mesh.normals.is_empty(), face_normals);
        let n = mesh.face_normal(0);
        assert!(mesh.normals.iter().all(|v| v.dot(n) > 0.999), "both normals are on one side");
        n.z > 0.0
    };
    for flip in [false, true] {
        assert_eq!(up(None, false, false, flip), !flip);
        assert_eq!(up(None, false, true, flip), flip);
        assert_eq!(up(None, true, true, flip), flip);
        assert_eq!(up(Some(1.0), false, false, flip), !flip);
        assert_eq!(up(Some(1.0), false, true, flip), !flip);
        assert_eq!(up(Some(1.0), true, true, flip), flip);
        assert_eq!(up(Some(-1.0), false, false, flip), flip);
        assert_eq!(up(Some(-1.0), false, true, flip), flip);
        assert_eq!(up(Some(-1.0), true, false, flip), !flip);
    }
    // Normals take the inverse transpose: the plane x + z = 0 stretched by 2 along x.
    let mut slope = triangles(&[[0., 0., 0.], [1., 0., -1.], [0., 1., 0.]], &[[0, 1, 2]]);
    slope.normals = vec![Vec3::new(1.0, 0.0, 1.0); 3];
    let mesh = Mesh::new(slope, &DMat4::from_scale(DVec3::new(2.0, 1.0, 1.0)), false).expect("a triangle");
    assert!((mesh.normals[0] - mesh.face_normal(0)).length() < 1e-6);
}

#[test]
fn creases_split_normals_and_vertices_but_not_the_surface() {
    let split = |degrees: f32, data: MeshData| world(MeshData { max_smooth_angle: Some(degrees.to_radians()), ..data });
    // A cube stays a cube below 90 degrees and becomes round at 90.
    let facets = split(80.0, cube());
    let round = split(90.0, cube());
    for t in 0..12u32 {
        for i in facets.triangles[t as usize] {
            assert!((facets.normals[i as usize] - facets.face_normal(t)).length() < 1e-6);
        }
        for i in round.triangles[t as usize] {
            let p = round.positions[i as usize];
            assert!((round.normals[i as usize] - p.normalize()).length() < 1e-6, "{p}");
        }
    }
    // A prism: 12 sides at 30 degrees to one another smooth together, the caps do not join in.
    let mut prism = MeshData::default();
    for i in 0..12 {
        let a = i as f32 / 12.0 * std::f32::consts::TAU;
        prism.positions.extend([Vec3::new(a.cos(), a.sin(), 0.0), Vec3::new(a.cos(), a.sin(), 1.0)]);
        let (a, b) = (2 * i, 2 * ((i + 1) % 12));
        prism.triangles.extend([[a, b, b + 1], [a, b + 1, a + 1]]);
        prism.triangles.extend([[24, b, a], [25, a + 1, b + 1]]);
    }
    prism.positions.extend([Vec3::ZERO, Vec3::Z]);
    let mesh = split(30.0, prism.clone());
    assert_eq!(mesh.positions.len(), 24 * 2 + 2, "each rim vertex once for the side and once for its cap");
    for (t, tri) in mesh.triangles.iter().enumerate() {
        for &i in tri {
            let (p, n) = (mesh.positions[i as usize], mesh.normals[i as usize]);
            let cap = mesh.face_normal(t as u32).z.abs() > 0.5;
            let want = if cap { mesh.face_normal(t as u32) } else { Vec3::new(p.x, p.y, 0.0) };
            assert!((n - want).length() < 1e-5, "{n} {want}");
        }
    }
    // Smoothing crosses uv seams here; uv stay with their vertices.
    let seam = split(40.0, globe(24, 48));
    for (p, n) in seam.positions.iter().zip(&seam.normals) {
        assert!(p.dot(*n) > 0.995, "{p} {n}");
    }
    assert_eq!(seam.uvs.len(), seam.positions.len());
    // Nonsense angles are no panic.
    for angle in [f32::NAN, f32::INFINITY, -1.0] {
        let data = MeshData { max_smooth_angle: Some(angle), ..cube() };
        assert_eq!(world(data).triangles.len(), 12);
    }
}

#[test]
fn bad_triangles_are_dropped_and_bad_meshes_refused() {
    let nan = f32::NAN;
    let p = [[0., 0., 0.], [1., 0., 0.], [0., 1., 0.], [nan, 0., 0.], [2., 0., 0.], [1., 0., 0.]];
    let mesh = world(triangles(&p, &[[0, 1, 3], [0, 1, 4], [0, 1, 2], [1, 1, 2], [0, 1, 5]]));
    assert_eq!(mesh.triangles, [[0, 1, 2]]);
    assert_eq!(mesh.bounds(), (Vec3::ZERO, Vec3::new(1.0, 1.0, 0.0)));
    assert_eq!((mesh.area(), mesh.triangle_area(0)), (0.5, 0.5));
    let error = |data: MeshData| Mesh::new(data, &DMat4::IDENTITY, false).expect_err("must be refused");
    assert_eq!(
        error(triangles(&p, &[[0, 1, 2], [0, 1, 6]])),
        "triangle 1 refers to vertex 6 but the mesh has 6 vertices"
    );
    assert!(error(triangles(&p, &[[0, 1, 3]])).contains("none of the 1 triangles"));
    assert!(error(MeshData::default()).contains("no triangles"));
    let mut short = triangles(&p, &[[0, 1, 2]]);
    short.normals = vec![Vec3::Z; 5];
    assert!(error(short).contains("5 normals"));
    // Normals and uv that are no numbers are neutralised.
    let mut odd = triangles(&p, &[[0, 1, 2]]);
    odd.normals = vec![Vec3::NAN, Vec3::ZERO, Vec3::Z, Vec3::Z, Vec3::Z, Vec3::Z];
    odd.uvs = vec![Vec2::NAN; 6];
    let mesh = world(odd);
    assert_eq!((mesh.normals[0], mesh.normals[1], mesh.normals[2]), (Vec3::ZERO, Vec3::ZERO, Vec3::Z));
    assert!(mesh.uvs.iter().all(|t| *t == Vec2::ZERO));
}

#[test]
fn the_result_does_not_depend_on_the_number_of_threads() {
    let mut data = globe(60, 90);
    for (i, p) in data.positions.iter_mut().enumerate() {
        *p *= 1.0 + 0.001 * unit_f32(hash(4, i as u64));
    }
    data.max_smooth_angle = Some(0.2);
    let build = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
        pool.install(|| world(data.clone()))
    };
    let (one, many) = (build(1), build(7));
    assert_eq!(one.positions, many.positions);
    assert_eq!(one.normals, many.normals);
    assert_eq!((one.triangles, one.edges, one.neighbors), (many.triangles, many.edges, many.neighbors));
}
