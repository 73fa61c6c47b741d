//! Traces rays from a file against a PLY mesh and measures the speed of one thread.
//!
//! `trace_rays [--portable] MESH.ply RAYS.f32 [HITS.bin]`
//!
//! RAYS.f32 holds little-endian f32 records: origin xyz, direction xyz, tmin, tmax. HITS.bin gets one record per ray: f32 t
//! (+inf: no hit) and u32 triangle (0xffffffff: no hit). One line of JSON on stdout: `build_s`, `closest_mrays` and
//! `any_mrays` (million rays per second of one thread). `--portable` does without AVX2; it must
//! find the same hits.

use dualux::accel::{Accel, Hit, Ray, Simd};
use dualux::formats::ply;
use dualux::math::Vec3;
use dualux::scene::mesh::{Mesh, MeshData};
use dualux::scene::{Geometry, Shape};
use std::error::Error;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::OnceLock;
use std::time::Instant;

fn main() -> ExitCode {
    let mut args: Vec<PathBuf> = std::env::args_os().skip(1).map(PathBuf::from).collect();
    let mut simd = Simd::Avx2;
    if args.first().is_some_and(|arg| arg.as_os_str() == "--portable") {
        args.remove(0);
        simd = Simd::Portable;
    }
    if !(2..=3).contains(&args.len()) {
        eprintln!("usage: trace_rays [--portable] MESH.ply RAYS.f32 [HITS.bin]");
        return ExitCode::from(2);
    }
    match run(&args[0], &args[1], args.get(2).map(PathBuf::as_path), simd) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::FAILURE
        }
    }
}

fn run(mesh: &Path, rays: &Path, hits: Option<&Path>, simd: Simd) -> Result<(), Box<dyn Error>> {
    let shape = shape(ply::read(mesh, false)?);
    let rays = read_rays(rays).map_err(|e| format!("{}: {e}", rays.display()))?;

    let start = Instant::now();
    let accel = Accel::with_simd(&[shape], simd);
    let build_s = start.elapsed().as_secs_f64();

    // Two rounds each, the better one counts: the first also pulls the tree into memory.
    let mut found = Vec::new();
    let (mut closest_s, mut any_s) = (f64::INFINITY, f64::INFINITY);
    for _ in 0..2 {
        let start = thread_seconds();
        found = rays.iter().map(|ray| accel.closest(ray)).collect::<Vec<Option<Hit>>>();
        closest_s = closest_s.min(thread_seconds() - start);

        let start = thread_seconds();
        let blocked = rays.iter().filter(|ray| accel.occluded(ray)).count();
        any_s = any_s.min(thread_seconds() - start);
        if blocked != found.iter().flatten().count() {
            return Err("nearest hit and occlusion disagree".into());
        }
    }
    if let Some(path) = hits {
        let record = |hit: &Option<Hit>| {
            let (t, prim) = hit.map_or((f32::INFINITY, u32::MAX), |h| (h.t, h.prim));
            [t.to_le_bytes(), prim.to_le_bytes()].concat()
        };
        let bytes = found.iter().flat_map(record).collect::<Vec<u8>>();
        std::fs::write(path, bytes).map_err(|e| format!("{}: {e}", path.display()))?;
    }
    let mrays = |seconds: f64| rays.len() as f64 / seconds * 1e-6;
    println!(
        "{{\"build_s\": {build_s:.4}, \"closest_mrays\": {:.4}, \"any_mrays\": {:.4}}}",
        mrays(closest_s),
        mrays(any_s)
    );
    Ok(())
}

/// Seconds this thread has run, or wall-clock time where the system does not tell (not Linux).
fn thread_seconds() -> f64 {
    static START: OnceLock<Instant> = OnceLock::new();
    let wall = START.get_or_init(Instant::now).elapsed().as_secs_f64();
    let nanoseconds = std::fs::read_to_string("/proc/thread-self/schedstat")
        .ok()
        .and_then(|text| text.split_whitespace().next()?.parse::<f64>().ok());
    nanoseconds.map_or(wall, |ns| ns * 1e-9)
}

/// A scene of one shape, with no more than queries need.
fn shape(data: MeshData) -> Shape {
    Shape {
        name: "mesh".into(),
        geometry: Geometry::Mesh(Mesh {
            positions: data.positions,
            normals: data.normals,
            uvs: data.uvs,
            triangles: data.triangles,
            edges: Vec::new(),
            neighbors: Vec::new(),
        }),
        material: 0,
        emission: None,
    }
}

fn read_rays(path: &Path) -> Result<Vec<Ray>, Box<dyn Error>> {
    let bytes = std::fs::read(path)?;
    if bytes.len() % 32 != 0 {
        return Err("not a whole number of records of 8 floats".into());
    }
    let ray = |record: &[u8]| {
        let f = |i: usize| f32::from_le_bytes([0, 1, 2, 3].map(|k| record[4 * i + k]));
        Ray { o: Vec3::new(f(0), f(1), f(2)), d: Vec3::new(f(3), f(4), f(5)), tmin: f(6), tmax: f(7) }
    };
    Ok(bytes.chunks_exact(32).map(ray).collect())
}
