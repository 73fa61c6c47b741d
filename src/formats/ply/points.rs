//! Headers of point clouds that are written: binary PLY, little-endian.

/// The header of `vertices` vertices, each of these properties in order: a type and the names of those that have it.
pub fn header(comment: &str, vertices: usize, properties: &[(&str, &[&str])]) -> Vec<u8> {
    let mut out = format!("ply\nformat binary_little_endian 1.0\ncomment {comment}\nelement vertex {vertices}\n");
    for (kind, names) in properties {
        names.iter().for_each(|name| out += &format!("property {kind} {name}\n"));
    }
    (out + "end_header\n").into_bytes()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn properties_follow_each_other_by_type() {
        let text = String::from_utf8(header("two", 7, &[("float", &["x", "y"]), ("uint", &["k"])])).unwrap();
        let lines: Vec<&str> = text.lines().collect();
        assert_eq!(
            lines[2..],
            [
                "comment two",
                "element vertex 7",
                "property float x",
                "property float y",
                "property uint k",
                "end_header"
            ]
        );
        assert!(text.ends_with("end_header\n"));
    }
}
