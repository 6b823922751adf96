"""Bytes of a log: MCAP records, protobuf messages and their packed form."""
