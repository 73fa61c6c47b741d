//! Properties: the elements that give an object a named value.

use super::super::attrs::Attrs;
use super::super::report::Checked;
use super::super::tree::{ObjectId, Property, Spectrum, Value};
use super::super::{transform, values};
use super::{File, Parser};
use crate::math::DVec3;
use roxmltree::Node;
use std::cell::Cell;

impl Parser<'_> {
    /// Reads a property into the object `parent`.
    pub(super) fn property(
        &mut self,
        node: Node,
        tag: &str,
        attrs: &Attrs,
        file: File,
        parent: ObjectId,
    ) -> Checked<()> {
        let report = self.report;
        let name = attrs.need("name", report)?;
        let value = |parser| attrs.need("value", report).and_then(|a| Attrs::parse(a, parser, report));
        let value = match tag {
            "integer" => Value::Integer(Attrs::parse(attrs.need("value", report)?, values::integer, report)?),
            "float" => Value::Float(value(values::number)?),
            "boolean" => Value::Boolean(Attrs::parse(attrs.need("value", report)?, values::boolean, report)?),
            "string" => Value::String(attrs.need("value", report)?.value.clone()),
            "point" | "vector" => Value::Vector(transform::vector(attrs, DVec3::ZERO, report)?),
            "rgb" => Value::Rgb(Attrs::parse(attrs.need("value", report)?, values::rgb, report)?),
            "srgb" => Value::Rgb(Attrs::parse(attrs.need("value", report)?, values::srgb, report)?),
            "spectrum" => self.spectrum(attrs)?,
            "transform" => Value::Transform(transform::parse(node, file.source, &mut self.params, report)?),
            _ => {
                report.unknown(attrs.loc, format!("<{tag}> is not supported; ignored"), None);
                return Ok(());
            }
        };
        attrs.finish(&["name", "value", "x", "y", "z", "filename"], report);
        let property = Property {
            name: self.property_name(&name.value, parent, file),
            written: name.value.clone(),
            name_loc: name.loc,
            loc: attrs.get("value").map_or(attrs.loc, |a| a.loc),
            value,
            used: Cell::new(false),
        };
        self.drop_double(parent, &property.name, property.name_loc);
        self.tree.objects[parent].properties.push(property);
        Ok(())
    }

    /// The value of a `<spectrum>` without type.
    fn spectrum(&self, attrs: &Attrs) -> Checked<Value> {
        match (attrs.get("value"), attrs.get("filename")) {
            (Some(value), None) => Ok(match Attrs::parse(value, values::spectrum, self.report)? {
                Ok(spectrum) => Value::Spectrum(spectrum),
                Err(rgb) => Value::Rgb(rgb),
            }),
            (None, Some(filename)) => Ok(Value::Spectrum(Spectrum::File(filename.value.clone()))),
            _ => Err(self.report.error(attrs.loc, "<spectrum> needs exactly one of \"value\" and \"filename\"")),
        }
    }
}
