"""Signatures: valid until a byte changes, and the same as those of other tools."""

import shutil
import stat
import subprocess

import pytest
from cryptography.hazmat.primitives import serialization
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey

from tests.tools.small_log import COMMITTED
from wayproof.harness.cli.main import main
from wayproof.harness.errors import InputError
from wayproof.harness.replay.signature import (
    fault_of_signature,
    fingerprint,
    new_key,
    read_private_key,
    read_public_key,
    sign,
)


@pytest.fixture
def log(tmp_path):
    return shutil.copy(COMMITTED, tmp_path / "a.mcap")


def openssh(key):
    form = serialization.PrivateFormat.OpenSSH
    return key.private_bytes(serialization.Encoding.PEM, form, serialization.NoEncryption())


def locked(key, passphrase):
    form, protection = serialization.PrivateFormat.PKCS8, serialization.BestAvailableEncryption
    return key.private_bytes(serialization.Encoding.PEM, form, protection(passphrase))


def test_a_signature_holds_until_a_byte_of_the_log_changes(log, tmp_path, capsys):
    key = tmp_path / "me.pem"
    assert main(["verify", "--new-key", str(key)]) == 0
    assert stat.S_IMODE(key.stat().st_mode) == 0o600
    assert main(["verify", str(log), "--no-simulation", "--sign", str(key)]) == 0
    public = read_public_key(tmp_path / "me.pem.pub")
    assert fingerprint(public) in capsys.readouterr().out
    assert fault_of_signature(log, public) is None
    data = bytearray(log.read_bytes())
    data[len(data) // 2] ^= 1
    log.write_bytes(data)
    assert "is not by key" in fault_of_signature(log, public)


def test_another_key_and_a_missing_or_short_signature_are_faults(log, tmp_path):
    new_key(tmp_path / "a.pem")
    other = read_public_key(new_key(tmp_path / "b.pem"))
    assert "no 'a.mcap.sig'" in fault_of_signature(log, other)
    path = sign(log, read_private_key(tmp_path / "a.pem"))
    assert "is not by key" in fault_of_signature(log, other)
    path.write_bytes(b"short")
    assert fault_of_signature(log, other) == "'a.mcap.sig' has 5 bytes, expected 64"


def test_a_signature_is_not_written_over(log, tmp_path):
    new_key(tmp_path / "a.pem")
    new_key(tmp_path / "b.pem")
    first = sign(log, read_private_key(tmp_path / "a.pem")).read_bytes()
    assert sign(log, read_private_key(tmp_path / "a.pem")).read_bytes() == first
    with pytest.raises(InputError, match="exists, by another key"):
        sign(log, read_private_key(tmp_path / "b.pem"))
    with pytest.raises(InputError, match="exists, expected a new name"):
        new_key(tmp_path / "a.pem")


def test_keys_in_the_form_of_openssh_are_read(log, tmp_path):
    key = Ed25519PrivateKey.generate()
    (tmp_path / "id").write_bytes(openssh(key))
    line = key.public_key().public_bytes(
        serialization.Encoding.OpenSSH, serialization.PublicFormat.OpenSSH
    )
    (tmp_path / "id.pub").write_bytes(line + b" me@here\n")
    sign(log, read_private_key(tmp_path / "id"))
    assert fault_of_signature(log, read_public_key(tmp_path / "id.pub")) is None


def test_openssl_agrees(log, tmp_path):
    openssl = shutil.which("openssl")
    if openssl is None:
        pytest.skip("no openssl here")
    key, public = tmp_path / "o.pem", tmp_path / "o.pub"
    subprocess.run([openssl, "genpkey", "-algorithm", "ed25519", "-out", key], check=True)
    subprocess.run([openssl, "pkey", "-in", key, "-pubout", "-out", public], check=True)
    signature = sign(log, read_private_key(key))
    assert fault_of_signature(log, read_public_key(public)) is None
    words = ["pkeyutl", "-verify", "-pubin", "-inkey", public, "-rawin", "-in", log]
    done = subprocess.run([openssl, *words, "-sigfile", signature], capture_output=True)
    assert done.returncode == 0, done.stderr


def wrong_keys():
    key = Ed25519PrivateKey.generate()
    other = ec.generate_private_key(ec.SECP256R1())
    return {
        "junk": (b"junk", "cannot be read, expected an Ed25519 private key"),
        "elliptic": (openssh(other), "expected an Ed25519 private key"),
        "locked": (locked(key, b"secret"), "under a passphrase, expected a terminal"),
        "large": (bytes(20_000), "20000 bytes, expected a key"),
    }


@pytest.mark.parametrize("case", ["junk", "elliptic", "locked", "large"])
def test_a_file_without_a_key_is_one_line(log, tmp_path, capsys, case):
    data, said = wrong_keys()[case]
    (tmp_path / "key").write_bytes(data)
    assert main(["verify", str(log), "--sign", str(tmp_path / "key")]) == 2
    error = capsys.readouterr().err
    assert said in error
    assert error.count("\n") == 1
    assert not (tmp_path / "a.mcap.sig").exists()


def test_a_passphrase_is_read_from_the_terminal(tmp_path, monkeypatch):
    key = Ed25519PrivateKey.generate()
    (tmp_path / "key").write_bytes(locked(key, b"secret"))
    monkeypatch.setattr("sys.stdin.isatty", lambda: True)
    monkeypatch.setattr("getpass.getpass", lambda _: "secret")
    assert read_private_key(tmp_path / "key").public_key() == key.public_key()
    monkeypatch.setattr("getpass.getpass", lambda _: "wrong")
    with pytest.raises(InputError, match="cannot be read"):
        read_private_key(tmp_path / "key")


def test_a_private_key_is_not_taken_for_the_public_one(tmp_path):
    new_key(tmp_path / "a.pem")
    with pytest.raises(InputError, match="a private key, expected the public one"):
        read_public_key(tmp_path / "a.pem")


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["x.mcap", "--new-key", "n"], "expected no log with it"),
        (["--sign", "{}"], "got no log"),
    ],
)
def test_signing_refuses_contradictory_options(capsys, words, said):
    assert main(["verify", *words]) == 2
    assert said in capsys.readouterr().err
