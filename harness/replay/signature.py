"""Ed25519 signatures of logs (RFC 8032): 64 bytes, in a file beside the log.

The bare format lets OpenSSL check a signature without this package:
`openssl pkeyutl -verify -pubin -inkey KEY.pub -rawin -in LOG -sigfile LOG.sig`.
"""

from __future__ import annotations

import base64
import getpass
import os
import sys
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

from cryptography.exceptions import InvalidSignature, UnsupportedAlgorithm
from cryptography.hazmat.primitives import serialization
from cryptography.hazmat.primitives.asymmetric.ed25519 import (
    Ed25519PrivateKey,
    Ed25519PublicKey,
)
from cryptography.hazmat.primitives.hashes import SHA256, Hash

from wayproof.harness.errors import InputError

ENDING = ".sig"
"""Suffix of the name of a signature, after that of the log."""

PUBLIC_ENDING = ".pub"
"""Suffix of the name of a public key, after that of the private key."""

SIZE = 64
"""Size of a signature, bytes."""

LARGEST_KEY = 16_384
"""Maximum size of a file with a key, bytes."""

OPENSSH = b"-----BEGIN OPENSSH PRIVATE KEY-----"

Key = TypeVar("Key")


def new_key(path: Path) -> Path:
    """Write a new private key, PEM, readable by its owner alone, and its public key beside it.

    Args:
        path: Path of the private key.

    Returns:
        Path of the public key.

    Raises:
        InputError: One of the files exists, or cannot be written.
    """
    key = Ed25519PrivateKey.generate()
    private = key.private_bytes(
        serialization.Encoding.PEM,
        serialization.PrivateFormat.PKCS8,
        serialization.NoEncryption(),
    )
    public = key.public_key().public_bytes(
        serialization.Encoding.PEM, serialization.PublicFormat.SubjectPublicKeyInfo
    )
    public_path = path.with_name(path.name + PUBLIC_ENDING)
    if public_path.exists():
        raise InputError(f"key '{public_path}': exists, expected a new name")
    _write_new(path, private, 0o600)
    _write_new(public_path, public, 0o644)
    return public_path


def read_private_key(path: Path) -> Ed25519PrivateKey:
    """Read a private key as OpenSSL (PEM) or `ssh-keygen -t ed25519` writes it.

    The passphrase of an encrypted PEM key is read from the terminal.

    Raises:
        InputError: There is no such file or key, or the passphrase is wrong.
    """
    data = _read_key(path)
    openssh = data.lstrip().startswith(OPENSSH)
    load = serialization.load_ssh_private_key if openssh else serialization.load_pem_private_key
    try:
        key = _parsed(path, "private", lambda: load(data, None))
    except TypeError:  # raised by cryptography for an encrypted key
        phrase = _passphrase(path)
        key = _parsed(path, "private", lambda: load(data, phrase))
    if not isinstance(key, Ed25519PrivateKey):
        raise InputError(f"key '{path}': {type(key).__name__}, expected an Ed25519 private key")
    return key


def read_public_key(path: Path) -> Ed25519PublicKey:
    """Read a public key as OpenSSL (PEM) or `ssh-keygen -t ed25519` (`ssh-ed25519 ...`) writes it.

    Raises:
        InputError: There is no such file or key.
    """
    data = _read_key(path)
    if b"PRIVATE KEY" in data:
        raise InputError(f"key '{path}': a private key, expected the public one")
    openssh = data.lstrip().startswith(b"ssh-")
    load = serialization.load_ssh_public_key if openssh else serialization.load_pem_public_key
    key = _parsed(path, "public", lambda: load(data))
    if not isinstance(key, Ed25519PublicKey):
        raise InputError(f"key '{path}': {type(key).__name__}, expected an Ed25519 public key")
    return key


def fingerprint(key: Ed25519PublicKey) -> str:
    """Return the SHA-256 of a public key as `ssh-keygen -l` prints it."""
    line = key.public_bytes(serialization.Encoding.OpenSSH, serialization.PublicFormat.OpenSSH)
    digest = Hash(SHA256())
    digest.update(base64.b64decode(line.split()[1]))
    return "SHA256:" + base64.b64encode(digest.finalize()).decode().rstrip("=")


def signature_path(log: Path) -> Path:
    """Return the path of the signature of a log, beside it."""
    return log.with_name(log.name + ENDING)


def sign(log: Path, key: Ed25519PrivateKey) -> Path:
    """Sign the bytes of a log; return the path of the signature.

    Signatures are deterministic, so signing twice with one key changes nothing.

    Raises:
        InputError: The log cannot be read, or has a signature by another key or of other bytes.
    """
    signature = key.sign(_read(log))
    path = signature_path(log)
    if path.exists():
        if _read(path) == signature:
            return path
        raise InputError(
            f"signature '{path}': exists, by another key or of another log; "
            "expected none, or that it is removed first"
        )
    _write_new(path, signature, 0o644)
    return path


def fault_of_signature(log: Path, key: Ed25519PublicKey) -> str | None:
    """Return why the signature of a log is invalid; None if it is valid."""
    path = signature_path(log)
    if not path.is_file():
        return f"no '{path.name}' beside the log"
    signature = _read(path)
    if len(signature) != SIZE:
        return f"'{path.name}' has {len(signature)} bytes, expected {SIZE}"
    try:
        key.verify(signature, _read(log))
    except InvalidSignature:
        return f"'{path.name}' is not by key {fingerprint(key)} over this log's bytes"
    return None


def _parsed(path: Path, kind: str, parse: Callable[[], Key]) -> Key:
    try:
        return parse()
    except (ValueError, UnsupportedAlgorithm):
        raise InputError(
            f"key '{path}': cannot be read, expected an Ed25519 {kind} key, PEM, or "
            "OpenSSH without a passphrase"
        ) from None


def _passphrase(path: Path) -> bytes:
    if not sys.stdin.isatty():
        raise InputError(f"key '{path}': under a passphrase, expected a terminal to ask for it")
    return getpass.getpass(f"passphrase of '{path}': ").encode()


def _read_key(path: Path) -> bytes:
    data = _read(path)
    if len(data) > LARGEST_KEY:
        raise InputError(f"key '{path}': {len(data)} bytes, expected a key")
    return data


def _read(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except OSError as error:
        raise InputError(f"'{path}': {error.strerror}") from None


def _write_new(path: Path, data: bytes, mode: int) -> None:
    """Write a new file."""
    try:
        descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, mode)
    except FileExistsError:
        raise InputError(f"'{path}': exists, expected a new name") from None
    except OSError as error:
        raise InputError(f"'{path}': {error.strerror}") from None
    with os.fdopen(descriptor, "wb") as file:
        file.write(data)
