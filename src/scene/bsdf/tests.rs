//! Properties of the models: to come.
