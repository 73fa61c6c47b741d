//! A hall with any number of lamps, written as a scene file: the same bytes on every machine.
//!
//! Lamps are squares in clusters, of eight colours with radiances over a range of 12, mostly turned down; their size goes with
//! 1 / sqrt(number), so that all halls are equally bright and differ in their number of lamps alone. Walls, pillars, tables and
//! one block of rough metal catch their light. The camera does not see the lamps themselves: with so many bright dots in it, a picture's
//! error would be that of their edges.

use crate::math::Vec3;
use crate::math::sampler::{hash, unit_f32};
use std::fmt::Write as _;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};

/// Radiance of each colour, one mesh each.
const COLORS: [[f32; 3]; 8] = [
    [9.0, 7.4, 5.4],
    [6.6, 8.9, 11.1],
    [17.3, 7.8, 5.2],
    [12.5, 27.7, 15.3],
    [42.3, 40.2, 38.1],
    [48.8, 30.5, 61.0],
    [83.9, 58.8, 16.8],
    [55.5, 99.9, 111.0],
];
/// Clusters of lamps.
const CLUSTERS: u64 = 160;
/// Edge of a lamp where there are a thousand.
const EDGE: f32 = 0.045;
/// Corners of the room in which lamps hang.
const ROOM: [Vec3; 2] = [Vec3::new(0.3, 0.5, 0.3), Vec3::new(11.7, 3.9, 7.7)];

/// Middle and half edges of lamp `i` of `n`; its normal is the cross product of the edges.
fn lamp(i: u64, n: u64) -> [Vec3; 3] {
    let r = |key: u64, k: u64| unit_f32(hash(hash(0x1a3b, key), k));
    let [lo, hi] = ROOM;
    let cluster = 1 + (r(i, 10 << 32) * CLUSTERS as f32) as u64;
    let around = |k: u64| r(cluster, k + (1 << 40));
    let middle = lo + (hi - lo) * Vec3::new(around(1), around(2), around(3));
    let own = |k: u64| r(i, k + (2 << 40));
    // Sums of three: bells without a transcendental function.
    let bell = |k: u64| own(k) + own(k + 1) + own(k + 2) - 1.5;
    let offset = Vec3::new(bell(1), 0.6 * bell(4), bell(7));
    let p = (middle + offset).clamp(lo, hi);
    let towards = Vec3::new(bell(10), bell(13) - 0.5, bell(16));
    let normal = if towards.length_squared() > 1e-4 { towards.normalize() } else { -Vec3::Y };
    let other = if normal.x.abs() < 0.7 { Vec3::X } else { Vec3::Z };
    let a = normal.cross(other).normalize();
    let half = 0.5 * EDGE * (1000.0 / n as f32).sqrt() * (0.6 + 0.8 * own(19));
    [p, a * half, normal.cross(a) * half]
}

/// Writes the hall with `n` lamps to `folder`: the path of its scene file.
pub fn write(folder: &Path, n: u64) -> std::io::Result<PathBuf> {
    let mut text = String::from(HALL);
    for (k, [r, g, b]) in COLORS.iter().enumerate() {
        let file = format!("lamps-{n}.{k}.ply");
        let own: Vec<u64> = (0..n).filter(|i| i % COLORS.len() as u64 == k as u64).collect();
        if own.is_empty() {
            continue;
        }
        let mut out = BufWriter::new(std::fs::File::create(folder.join(&file))?);
        write!(
            out,
            "ply\nformat binary_little_endian 1.0\nelement vertex {}\nproperty float x\nproperty float y\nproperty float z\n\
             element face {}\nproperty list uchar int vertex_indices\nend_header\n",
            4 * own.len(),
            2 * own.len()
        )?;
        for &i in &own {
            let [p, a, b] = lamp(i, n);
            for corner in [p - a - b, p + a - b, p + a + b, p - a + b] {
                corner.to_array().iter().try_for_each(|c| out.write_all(&c.to_le_bytes()))?;
            }
        }
        for i in 0..own.len() as u32 {
            for triangle in [[0, 1, 2], [0, 2, 3]] {
                out.write_all(&[3])?;
                triangle.iter().try_for_each(|c: &u32| out.write_all(&(4 * i + c).to_le_bytes()))?;
            }
        }
        out.flush()?;
        // Writing to a string cannot fail.
        let _ = writeln!(
            text,
            "    <shape type=\"ply\"><string name=\"filename\" value=\"{file}\"/><boolean name=\"face_normals\" value=\"true\"/>\
             <ref id=\"black\"/><emitter type=\"area\"><rgb name=\"radiance\" value=\"{r}, {g}, {b}\"/></emitter></shape>"
        );
    }
    text += "</scene>\n";
    let path = folder.join(format!("lamps-{n}.xml"));
    std::fs::write(&path, text)?;
    Ok(path)
}

/// Everything but the lamps.
const HALL: &str = r#"<scene version="3.0.0">
    <integrator type="path"><boolean name="hide_emitters" value="true"/></integrator>
    <sensor type="perspective">
        <string name="fov_axis" value="x"/><float name="fov" value="70"/>
        <transform name="to_world"><lookat origin="0.8, 2.2, 7.4" target="6.5, 1.2, 2.5" up="0, 1, 0"/></transform>
        <film type="hdrfilm">
            <integer name="width" value="256"/><integer name="height" value="160"/><rfilter type="box"/>
        </film>
    </sensor>
    <bsdf type="diffuse" id="wall"><rgb name="reflectance" value="0.7, 0.68, 0.64"/></bsdf>
    <bsdf type="diffuse" id="floor"><rgb name="reflectance" value="0.4, 0.34, 0.28"/></bsdf>
    <bsdf type="diffuse" id="table"><rgb name="reflectance" value="0.55, 0.3, 0.2"/></bsdf>
    <bsdf type="diffuse" id="black"><rgb name="reflectance" value="0, 0, 0"/></bsdf>
    <bsdf type="roughconductor" id="metal"><string name="material" value="Al"/><float name="alpha" value="0.25"/></bsdf>
    <shape type="cube"><transform name="to_world"><scale x="6.2" y="0.1" z="4.2"/><translate x="6" y="-0.1" z="4"/></transform><ref id="floor"/></shape>
    <shape type="cube"><transform name="to_world"><scale x="6.2" y="0.1" z="4.2"/><translate x="6" y="4.3" z="4"/></transform><ref id="wall"/></shape>
    <shape type="cube"><transform name="to_world"><scale x="0.1" y="2.2" z="4"/><translate x="-0.1" y="2.1" z="4"/></transform><ref id="wall"/></shape>
    <shape type="cube"><transform name="to_world"><scale x="0.1" y="2.2" z="4"/><translate x="12.1" y="2.1" z="4"/></transform><ref id="wall"/></shape>
    <shape type="cube"><transform name="to_world"><scale x="6.2" y="2.2" z="0.1"/><translate x="6" y="2.1" z="-0.1"/></transform><ref id="wall"/></shape>
    <shape type="cube"><transform name="to_world"><scale x="6.2" y="2.2" z="0.1"/><translate x="6" y="2.1" z="8.1"/></transform><ref id="wall"/></shape>
    <shape type="cube"><transform name="to_world"><scale x="0.18" y="2.1" z="0.18"/><translate x="4" y="2.1" z="2.2"/></transform><ref id="wall"/></shape>
    <shape type="cube"><transform name="to_world"><scale x="0.18" y="2.1" z="0.18"/><translate x="8" y="2.1" z="2.2"/></transform><ref id="wall"/></shape>
    <shape type="cube"><transform name="to_world"><scale x="0.18" y="2.1" z="0.18"/><translate x="8" y="2.1" z="5.8"/></transform><ref id="wall"/></shape>
    <shape type="cube"><transform name="to_world"><scale x="1.2" y="0.05" z="0.6"/><translate x="3.4" y="0.8" z="5"/></transform><ref id="table"/></shape>
    <shape type="cube"><transform name="to_world"><scale x="1.2" y="0.05" z="0.6"/><translate x="6.6" y="0.8" z="3.4"/></transform><ref id="table"/></shape>
    <shape type="cube"><transform name="to_world"><scale x="0.4" y="0.4" z="0.4"/><rotate y="1" angle="35"/><translate x="5" y="0.4" z="4.4"/></transform><ref id="metal"/></shape>
"#;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::formats::{self, LoadOptions};
    use crate::scene::Scene;

    #[test]
    fn halls_have_their_lamps_the_same_power_and_the_same_bytes() {
        let folder = tempfile::tempdir().unwrap();
        let load = |n: u64| {
            let path = write(folder.path(), n).unwrap();
            Scene::new(formats::load(&path, &LoadOptions::default()).unwrap().description).unwrap()
        };
        let power = |s: &Scene| s.lights.infos.iter().map(|l| l.power.x).sum::<f32>();
        let (few, many) = (load(800), load(6400));
        // The two triangles of a lamp are one emitter.
        assert_eq!((few.lights.emitter_count(), many.lights.emitter_count()), (800, 6400));
        assert!((power(&many) / power(&few) - 1.0).abs() < 0.05, "{} {}", power(&few), power(&many));
        let bytes = || std::fs::read(folder.path().join("lamps-800.3.ply")).unwrap();
        let before = bytes();
        write(folder.path(), 800).unwrap();
        assert_eq!(before, bytes());
        // One lamp alone has one colour.
        assert_eq!(load(1).lights.emitter_count(), 1);
    }
}
