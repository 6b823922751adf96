"""Reading of logs whose content is not to be trusted."""

import hashlib
import json

from mcap.writer import Writer

from wayproof.harness.cli.main import main
from wayproof.harness.log.codec.container import (
    Attachment,
    Metadata,
    Packet,
    walk,
)
from wayproof.harness.log.writer import digest_name
from wayproof.harness.schema import wayproof_pb2 as pb


def write_items(items, target):
    """A log of these items, whose checksums hold."""
    with target.open("wb") as file:
        writer = Writer(file)
        writer.start(profile="wayproof")
        channels = {}
        for item in items:
            if isinstance(item, Metadata):
                writer.add_metadata(item.name, item.fields)
            elif isinstance(item, Attachment):
                writer.add_attachment(0, 0, item.name, "", item.data)
            else:
                if item.topic not in channels:
                    schema = writer.register_schema(item.schema, "protobuf", b"")
                    channels[item.topic] = writer.register_channel(item.topic, "protobuf", schema)
                writer.add_message(channels[item.topic], item.time_ns, item.data, item.time_ns)
        writer.finish()
    return target


def rewritten(source, target, change):
    """A log with valid checksums and digests whose config was changed."""
    items = list(walk(source))
    config = json.loads(next(one.data for one in items if one[0] == "config.json"))
    change(config)
    data = json.dumps(config).encode()
    digest = {digest_name("config.json"): hashlib.sha256(data).hexdigest()}
    for at, item in enumerate(items):
        if isinstance(item, Metadata):
            items[at] = item._replace(fields={**item.fields, **digest})
        elif isinstance(item, Attachment) and item.name == "config.json":
            items[at] = item._replace(data=data)
    return write_items(items, target)


def test_code_named_in_a_log_is_not_imported(source, tmp_path, capsys, monkeypatch):
    monkeypatch.syspath_prepend(tmp_path)
    evil = tmp_path / "evil.py"
    evil.write_text(f"open({str(tmp_path / 'touched')!r}, 'w')\nclass Planner: ...\n")

    def name_it(config):
        config["planner"]["name"] = "evil:Planner"

    path = rewritten(source, tmp_path / "evil.mcap", name_it)
    copy = ["--log", str(tmp_path / "copy.mcap")]
    for verb in (["replay"], ["replay", "simulate"], ["audit"], ["export", *copy]):
        assert main([*verb, str(path)]) == 2
        assert "expected --allow-plugins" in capsys.readouterr().err
    assert not (tmp_path / "touched").exists()


def test_a_name_that_no_registry_has_is_one_line(source, tmp_path, capsys):
    def misspell(config):
        config["map"]["kind"] = "vyxel"

    path = rewritten(source, tmp_path / "misspelt.mcap", misspell)
    assert main(["replay", str(path)]) == 2
    assert "unknown map.kind 'vyxel'; did you mean 'voxel'?" in capsys.readouterr().err


def test_an_error_is_one_printable_line(tmp_path, capsys):
    for name in ("a\x1b[31mb", "a\nb", "a\u2028b", "a\x85b"):
        assert main(["replay", str(tmp_path / name)]) == 2
        error = capsys.readouterr().err
        assert error.endswith("no such file\n")
        assert error[:-1].isprintable()


def test_a_text_that_looks_like_markup_is_printed_as_it_stands(source, tmp_path, capsys):
    items = list(walk(source))
    for at, item in enumerate(items):
        if isinstance(item, Packet) and item.schema == pb.Decision.DESCRIPTOR.full_name:
            decision = pb.Decision.FromString(item.data)
            decision.reason = "[/x] :warning: $\\frac{$"
            items[at] = item._replace(data=decision.SerializeToString())
    path = write_items(items, tmp_path / "markup.mcap")
    drawn = ["--png", str(tmp_path / "moment.png")]
    assert main(["explain", str(path), "1", *drawn]) == 2  # the chain is not that of the reasons
    assert main(["explain", str(path), "1", *drawn, "--unchecked"]) == 0
    assert "[/x] :warning: $\\frac{$" in capsys.readouterr().out
