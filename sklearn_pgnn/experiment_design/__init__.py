"""Design of experiments: detectable sizes of effects, and inputs that separate two causes."""
