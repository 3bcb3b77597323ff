"""Who wrote a bundle: keys, signatures, and what is refused."""

import os
import re
import shutil
import stat
import subprocess
from pathlib import Path

import numpy as np
import pytest

from taxel.bundles.envelope import (
    FIRST_WORDS,
    is_grasp_bundle,
    is_signed,
    kind_of,
    pack,
    signed,
    signed_file,
    unpack,
)
from taxel.bundles.grasp import read_grasp_bundle
from taxel.bundles.shipped import CUP_POUR, shipped_bundle
from taxel.bundles.signing import fingerprint, new_key, read_key, read_trust
from taxel.cli.main import main
from taxel.errors import BadBundle, BadInput

MEMBERS = {"grasp.json": b"{}", "head.onnx": bytes(1000)}
GRASP_MEMBERS = ("grasp.json", "head.onnx", "check_features.npy", "check_probabilities.npy")


@pytest.fixture
def key(tmp_path):
    new_key(tmp_path / "key")
    return tmp_path / "key"


@pytest.fixture
def trust(key):
    return read_trust(key.with_name("key.pub"))


@pytest.fixture
def bundle(tmp_path, key):
    path = tmp_path / "some.taxel"
    path.write_bytes(signed(pack(MEMBERS), read_key(key)))
    return path


def test_a_signed_bundle_opens_with_and_without_its_key(bundle, trust):
    names = tuple(MEMBERS)
    assert unpack(bundle, names, trust) == unpack(bundle, names) == MEMBERS
    assert is_signed(bundle)
    assert is_grasp_bundle(bundle)


def test_a_grasp_bundle_that_comes_with_taxel_can_be_signed(tmp_path, key, trust):
    path = tmp_path / "mine.taxel"
    main(["bundle", str(shipped_bundle(CUP_POUR)), "--sign", str(key), "--output", str(path)])

    assert read_grasp_bundle(path, trust=trust).contract.cameras == 2
    with pytest.raises(BadBundle, match="without a signature"):
        read_grasp_bundle(shipped_bundle(CUP_POUR), trust=trust)


@pytest.mark.parametrize("contract", ["bundle.json", "grasp.json", "trials.json"])
def test_a_bundle_whose_models_cannot_be_opened_is_not_signed(tmp_path, key, contract, capsys):
    """Its checksum fits; what it holds is no contract, or no model."""
    members = {contract: b"{}"}
    if contract == "grasp.json":
        shipped = unpack(shipped_bundle(CUP_POUR), GRASP_MEMBERS)
        members = shipped | {"head.onnx": bytes(1000)}
    before = pack(members)
    path = tmp_path / "b.taxel"
    path.write_bytes(before)

    for output in (path, tmp_path / "signed.taxel"):
        with pytest.raises(SystemExit) as ended:
            main(["bundle", str(path), "--sign", str(key), "--output", str(output)])
        (line,) = capsys.readouterr().err.splitlines()
        assert (ended.value.code, line[:14]) == (2, "taxel: needed ")
    assert path.read_bytes() == before
    assert not (tmp_path / "signed.taxel").exists()


def test_nothing_of_a_signed_bundle_can_be_changed(bundle, trust):
    """Whichever byte is changed, of the words, the signature or a member."""
    whole = bundle.read_bytes()
    places = np.linspace(0, len(whole) - 1, 200).astype(int).tolist() + list(
        range(len(FIRST_WORDS))
    )
    for place in places:
        changed = bytearray(whole)
        changed[place] ^= 1
        bundle.write_bytes(changed)
        with pytest.raises(BadBundle):
            unpack(bundle, (), trust)


def test_members_that_were_changed_with_a_new_checksum_are_refused(bundle, trust):
    """A checksum proves that a file is whole, not whose it is."""
    signature = bundle.read_bytes().partition(b"\n")[0].split()[-1]
    line, _, body = pack(MEMBERS | {"head.onnx": bytes(1001)}).partition(b"\n")
    bundle.write_bytes(line + b" " + signature + b"\n" + body)

    unpack(bundle, ())
    with pytest.raises(BadBundle, match="does not fit its contents"):
        unpack(bundle, (), trust)


@pytest.mark.parametrize("signature", [b"", b" ", b" x", b" " + b"A" * 240, b" " + b"=" * 10**5])
def test_anything_else_than_a_signature_is_refused(tmp_path, trust, signature):
    line, _, body = pack(MEMBERS).partition(b"\n")
    (tmp_path / "b.taxel").write_bytes(line + signature + b"\n" + body)

    with pytest.raises(BadBundle):
        unpack(tmp_path / "b.taxel", (), trust)


def test_a_stranger_s_signature_is_refused_by_name(tmp_path, bundle):
    strangers = read_trust(new_key(tmp_path / "other"))

    with pytest.raises(BadBundle, match="signed by SHA256:"):
        unpack(bundle, (), strangers)


def test_several_keys_may_be_trusted(tmp_path, bundle, key):
    both = tmp_path / "both.pub"
    other = new_key(tmp_path / "other").read_text()
    both.write_text(f"# the team\n\n{other}{key.with_name('key.pub').read_text()}")

    assert unpack(bundle, tuple(MEMBERS), read_trust(both)) == MEMBERS


def test_signing_again_replaces_the_signature(tmp_path, bundle, trust):
    other = read_trust(new_key(tmp_path / "other"))
    bundle.write_bytes(signed_file(bundle, read_key(tmp_path / "other")))

    assert unpack(bundle, tuple(MEMBERS), other) == MEMBERS
    with pytest.raises(BadBundle):
        unpack(bundle, (), trust)


def test_a_damaged_bundle_is_not_signed(bundle, key):
    bundle.write_bytes(bundle.read_bytes() + b"x")

    with pytest.raises(BadBundle, match="checksum"):
        signed_file(bundle, read_key(key))


def test_a_private_key_is_its_owner_s_alone_and_never_replaced(tmp_path, key):
    mode = stat.S_IMODE(key.stat().st_mode)
    before = key.read_bytes()

    assert mode == 0o600
    with pytest.raises(BadInput, match="never replaced"):
        new_key(key)
    key.rename(tmp_path / "moved")
    with pytest.raises(BadInput, match="never replaced"):  # its public half stands there
        new_key(key)
    assert not key.exists()
    os.symlink(tmp_path / "nowhere", tmp_path / "link")
    with pytest.raises(BadInput, match="never replaced"):
        new_key(tmp_path / "link")
    assert (tmp_path / "moved").read_bytes() == before


def test_a_private_key_that_others_can_read_is_refused(key):
    key.chmod(0o640)

    with pytest.raises(BadInput, match="only its owner"):
        read_key(key)


NO_KEYS = [b"", bytes(100), b"ssh-rsa AAAAB3NzaC1yc2E= x", b"\xff" * 70_000, b"ssh-ed25519 AAAA x",
           b"-----BEGIN OPENSSH PRIVATE KEY-----\n"]  # fmt: skip


@pytest.mark.parametrize("content", NO_KEYS)
def test_other_files_are_no_keys(tmp_path, content):
    path = tmp_path / "odd"
    path.write_bytes(content)
    path.chmod(0o600)

    for read in (read_key, read_trust):
        with pytest.raises(BadInput):
            read(path)
    with pytest.raises(BadInput):
        read_trust(tmp_path / "absent")


needs_ssh = pytest.mark.skipif(shutil.which("ssh-keygen") is None, reason="no ssh-keygen")


@needs_ssh
def test_keys_of_ssh_keygen_are_keys_here(tmp_path):
    run = ["ssh-keygen", "-q", "-t", "ed25519", "-C", "a b", "-f", str(tmp_path / "k")]
    subprocess.run([*run, "-N", ""], check=True)
    (tmp_path / "b.taxel").write_bytes(signed(pack(MEMBERS), read_key(tmp_path / "k")))
    trust = read_trust(tmp_path / "k.pub")
    printed = subprocess.run(["ssh-keygen", "-l", "-f", tmp_path / "k.pub"], capture_output=True,
                             check=True, text=True).stdout  # fmt: skip

    assert unpack(tmp_path / "b.taxel", tuple(MEMBERS), trust) == MEMBERS
    assert fingerprint(trust.keys[0]) in printed


@needs_ssh
def test_a_key_with_a_passphrase_asks_for_it(tmp_path):
    subprocess.run(["ssh-keygen", "-q", "-t", "ed25519", "-f", tmp_path / "k", "-N", "secret"],
                   check=True)  # fmt: skip

    assert read_key(tmp_path / "k", lambda _: "secret").public == read_trust(
        tmp_path / "k.pub").keys[0]  # fmt: skip
    with pytest.raises(BadInput, match="passphrase"):
        read_key(tmp_path / "k")
    with pytest.raises(BadInput, match="private Ed25519"):
        read_key(tmp_path / "k", lambda _: "wrong")


@needs_ssh
def test_openssh_itself_verifies_a_bundle_by_the_commands_of_the_docs(tmp_path, bundle, key):
    page = Path(__file__).parents[2] / "docs" / "explanation" / "trust.md"
    (script,) = re.findall(r"^```bash\n(.*?)^```", page.read_text(), re.M | re.S)
    bundle.rename(tmp_path / "object.taxel")
    key.with_name("key.pub").rename(tmp_path / "taxel-key.pub")
    whole = (tmp_path / "object.taxel").read_bytes()

    def verified() -> str:
        done = subprocess.run(["bash", "-c", script], cwd=tmp_path, capture_output=True, text=True,
                              check=False)  # fmt: skip
        return done.stdout

    digest = whole.split(b" ")[4].decode()
    assert 'Good "taxel-bundle" signature for author' in verified()
    assert digest in verified()
    changed = whole.replace(digest.encode(), b"0" * 64)
    (tmp_path / "object.taxel").write_bytes(changed)
    assert "Good" not in verified()


def test_live_refuses_in_one_line_what_it_does_not_trust(tmp_path, key, capsys):
    """A grasp bundle or a station's: before anything else is opened, as no such source could be."""
    words = ["live", CUP_POUR, "sim://nothing", "--trust", str(key.with_name("key.pub"))]
    for more in ([], ["--record", str(tmp_path / "r.mcap")]):
        with pytest.raises(SystemExit) as ended:
            main([*words, "--seconds", "1", *more])
        lines = capsys.readouterr().err.splitlines()
        assert ended.value.code == 2
        (line,) = [line for line in lines if line.startswith("taxel: ")]
        assert "without a signature" in line


def test_a_key_is_made_from_the_command_line(tmp_path, capsys):
    main(["bundle", "--new-key", str(tmp_path / "k")])
    printed = capsys.readouterr().out

    assert "SHA256:" in printed
    with pytest.raises(SystemExit) as ended:
        main(["bundle", "--new-key", str(tmp_path / "k")])
    assert ended.value.code == 2


@pytest.mark.parametrize("name", ["bundle.json", "grasp.json", "trials.json"])
def test_a_bundles_kind_stands_in_its_first_line_and_is_signed_with_it(tmp_path, key, trust, name):
    kind = {"bundle.json": "array"}.get(name, name.removesuffix(".json"))
    path = tmp_path / "b.taxel"
    path.write_bytes(signed(pack({name: b"{}", "model.onnx": bytes(9)}), read_key(key)))
    assert path.read_bytes().startswith(f"TAXEL BUNDLE 2 {kind} ".encode())
    assert kind_of(path) == kind

    other = "array" if kind != "array" else "grasp"
    path.write_bytes(path.read_bytes().replace(kind.encode(), other.encode(), 1))
    with pytest.raises(BadBundle, match="does not fit its contents"):
        unpack(path, (), trust)


@pytest.mark.parametrize("name", ["bundle.json", "grasp.json", "trials.json"])
def test_a_bundle_made_before_its_line_named_a_kind_still_opens(tmp_path, key, trust, name):
    members = {name: b"{}", "model.onnx": bytes(9)}
    line, _, body = pack(members).partition(b"\n")
    path = tmp_path / "b.taxel"
    before = b"TAXEL BUNDLE 1 " + line.split()[-1] + b"\n" + body
    path.write_bytes(before)
    assert kind_of(path) == {"bundle.json": "array"}.get(name, name.removesuffix(".json"))
    assert unpack(path, tuple(members)) == members

    path.write_bytes(signed(before, read_key(key)))
    assert unpack(path, tuple(members), trust) == members


@pytest.mark.parametrize(
    "content", [b"", b"TAXEL BUNDLE 1 x\n", b"TAXEL BUNDLE 2 hat " + b"0" * 64]
)
def test_what_is_no_bundle_has_no_kind(tmp_path, content):
    (tmp_path / "b.taxel").write_bytes(content)

    assert kind_of(tmp_path / "b.taxel") is None
    assert kind_of(tmp_path / "absent.taxel") is None
