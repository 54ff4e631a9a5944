//! The JSON Schema of a scene.

use schemars::generate::SchemaSettings;

use super::Scene;

/// The JSON Schema (draft 2020-12) of a scene, with descriptions and defaults.
pub fn json_schema() -> serde_json::Value {
    let mut schema = SchemaSettings::draft2020_12()
        .into_generator()
        .into_root_schema_for::<Scene>();
    schema.insert("title".into(), "urlsph scene".into());
    schema.into()
}
