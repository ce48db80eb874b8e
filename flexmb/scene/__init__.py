"""Descriptions of multibody systems (scenes): schema, builder, files and checks, without physics or compiled code."""
