//! Shapes with their materials and area lights.
//!
//! Not handled hair, height fields, signed distance grids: skipped with a warning. Instances are copied.

use super::builder::{Builder, PendingMesh};
use super::emitter;
use super::props::Props;
use super::report::{Checked, Loc};
use super::tree::ObjectId;
use crate::formats::assets::MeshKind;
use crate::formats::diagnostics::suggestion;
use crate::math::{DMat4, DVec3};
use crate::scene::description::{GeometryDesc, ShapeDesc};
use crate::scene::mesh::MeshData;

const SHAPES: [&str; 10] =
    ["rectangle", "cube", "sphere", "disk", "cylinder", "obj", "ply", "serialized", "shapegroup", "instance"];

/// Most shapes that instances may make.
const SHAPE_LIMIT: usize = 1 << 20;

/// Reads a shape of the scene; `number` is its place in the file.
pub fn read(b: &mut Builder, id: ObjectId, number: usize) -> Checked<()> {
    let props = b.props(id);
    match props.object.kind.as_str() {
        // Shown by its instances only.
        "shapegroup" => Ok(()),
        "instance" => instance(b, &props, number),
        _ => single(b, &props, number, DMat4::IDENTITY),
    }
}

/// Copies the shapes of a group.
fn instance(b: &mut Builder, props: &Props, number: usize) -> Checked<()> {
    let to_world = props.to_world()?;
    let (group, loc) = props.nested_count("shape", 1, 1)?[0];
    props.finish();
    let group = b.props(group);
    if group.object.kind != "shapegroup" {
        return Err(b.report.error(loc, "an instance shows a shape of type \"shapegroup\""));
    }
    let parts = group.nested("shape");
    group.finish();
    // The group is read once for each instance: what was read must be found again.
    group.reopen(&["shape"]);
    for (part, loc) in parts {
        let part = b.props(part);
        if matches!(part.object.kind.as_str(), "shapegroup" | "instance") {
            return Err(b.report.error(loc, "instances cannot be nested"));
        }
        if b.shapes.len() >= SHAPE_LIMIT {
            return Err(b.report.error(props.object.loc, "instances make too many shapes"));
        }
        part.reopen(&["bsdf", "emitter"]);
        single(b, &part, number, to_world)?;
    }
    Ok(())
}

/// Reads one shape that is no instance; `outer` is applied after its own `to_world`.
fn single(b: &mut Builder, props: &Props, number: usize, outer: DMat4) -> Checked<()> {
    let kind = props.object.kind.as_str();
    if !SHAPES.contains(&kind) {
        let message = format!("unknown shape type \"{kind}\"; skipped");
        b.report.unknown(props.object.kind_loc, message, suggestion(kind, SHAPES));
        return Ok(());
    }
    let to_world = outer * props.to_world()?;
    props.check(to_world.is_finite(), "to_world", "becomes too large")?;
    let mut flip_normals = props.boolean_or("flip_normals", false)?;
    let mut file = None;
    let geometry = match kind {
        "rectangle" => GeometryDesc::Rectangle,
        "cube" => GeometryDesc::Cube,
        "disk" => GeometryDesc::Disk,
        "sphere" => {
            let center = props.vector("center")?.unwrap_or(DVec3::ZERO);
            let radius = radius(props, &mut flip_normals)?;
            if !uniform(to_world) {
                return Err(props.error("to_world", "a sphere must not be scaled unevenly or sheared"));
            }
            GeometryDesc::Sphere { center, radius }
        }
        "cylinder" => {
            let p0 = props.vector("p0")?.unwrap_or(DVec3::ZERO);
            let p1 = props.vector("p1")?.unwrap_or(DVec3::Z);
            let radius = radius(props, &mut flip_normals)?;
            props.check(p0.distance_squared(p1) > 0.0, "p1", "must differ from p0")?;
            GeometryDesc::Cylinder { p0, p1, radius }
        }
        _ => {
            file = Some(mesh(b, props, kind)?);
            GeometryDesc::Mesh(MeshData::default())
        }
    };
    let (material, emission) = surface(b, props)?;
    props.ignore(&["sampling_weight", "silhouette_sampling_weight", "id"]);
    props.finish();
    if let Some((file, face_normals, max_smooth_angle)) = file {
        let shape = b.shapes.len();
        b.pending.push(PendingMesh { shape, file, face_normals, max_smooth_angle });
    }
    let name = props.object.id.clone().unwrap_or_else(|| format!("shape {number} ({kind})"));
    b.shapes.push(ShapeDesc { name, geometry, to_world, flip_normals, material, emission });
    Ok(())
}

/// The radius; a negative one turns the surface inside out.
fn radius(props: &Props, flip_normals: &mut bool) -> Checked<f64> {
    let radius = props.float_or("radius", 1.0)?;
    props.check(radius.abs() > 1e-30, "radius", "must not be 0")?;
    *flip_normals ^= radius < 0.0;
    Ok(radius.abs())
}

/// Whether a transform keeps spheres round.
fn uniform(m: DMat4) -> bool {
    let axes = [m.x_axis, m.y_axis, m.z_axis].map(|a| a.truncate());
    let square = axes[0].length_squared();
    square > 0.0
        && (0..3).all(|i| {
            (0..=i).all(|j| {
                let expected = if i == j { square } else { 0.0 };
                (axes[i].dot(axes[j]) - expected).abs() < 2e-3 * square
            })
        })
}

/// Place of the mesh file, facets, crease angle.
fn mesh(b: &mut Builder, props: &Props, kind: &str) -> Checked<(usize, bool, Option<f32>)> {
    let face_normals = props.boolean_or("face_normals", false)?;
    let angle = props.float("max_smooth_angle")?;
    props.check(angle.is_none_or(|a| (0.0..=180.0).contains(&a)), "max_smooth_angle", "must lie between 0 and 180")?;
    let kind = match kind {
        "obj" => MeshKind::Obj(props.boolean_or("flip_tex_coords", true)?),
        "ply" => MeshKind::Ply(props.boolean_or("flip_tex_coords", false)?),
        _ => {
            props.ignore(&["flip_tex_coords"]);
            MeshKind::Serialized(props.count("shape_index", 0, i64::from(u32::MAX))?.unwrap_or(0) as u32)
        }
    };
    props.ignore(&["collapse", "srgb", "load_materials", "vertex_colors"]);
    let file = b.mesh(props, kind)?;
    Ok((file, face_normals, angle.map(|a| a.to_radians() as f32)))
}

/// Material and emission.
fn surface(b: &mut Builder, props: &Props) -> Checked<(u32, Option<crate::scene::texture::Color>)> {
    let lamps = props.nested("emitter");
    if let Some(&(_, loc)) = lamps.get(1) {
        return Err(b.report.error(loc, "a shape takes one emitter only"));
    }
    let emission = match lamps.first() {
        Some(&(id, _)) => emitter::area(b, id)?,
        None => None,
    };
    let bsdfs = props.nested("bsdf");
    if let Some(&(_, loc)) = bsdfs.get(1) {
        b.report.warn(loc, "a shape takes one bsdf only; the first one counts");
    }
    let unsupported = |list: Vec<(ObjectId, Loc)>, what: &str| {
        for (_, loc) in list {
            b.report.unknown(loc, format!("{what} on shapes are not supported; ignored"), None);
        }
    };
    unsupported(props.nested("sensor"), "sensors");
    unsupported(props.nested("subsurface"), "subsurface models");
    let material = match bsdfs.first() {
        Some(&(id, loc)) => b.material(id, loc)?,
        None => b.default_material(emission.is_some()),
    };
    Ok((material, emission))
}
