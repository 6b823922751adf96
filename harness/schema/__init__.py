"""Protobuf messages of the log."""
