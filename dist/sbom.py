#!/usr/bin/env python3
"""Lists every crate in the program: what is linked into it or runs while it is built.

    sbom.py TARGET                  CycloneDX 1.5 as JSON, on standard output
    sbom.py TARGET --licenses       the texts of their licenses
    sbom.py TARGET --check FILE     compares with what Cargo built, by its messages (--message-format json)

The same sources give the same bytes. Checksums are those of Cargo.lock.
"""

import json
import os
import pathlib
import re
import subprocess
import sys
import tomllib
import uuid

ROOT = pathlib.Path(__file__).resolve().parent.parent
PROGRAM = "haptic-study"
STANDARD_LIBRARY = "rust-std"
LICENSE_FILE = re.compile(r"^(licen[cs]e|copying|notice|unlicense)", re.IGNORECASE)


def cargo(*arguments: str) -> str:
    done = subprocess.run(["cargo", *arguments], cwd=ROOT, check=True, capture_output=True, text=True)
    return done.stdout


def crates(target: str) -> tuple[dict, dict, str]:
    """The packages, those on which each depends, and the program; by name and version."""
    meta = json.loads(cargo("metadata", "--locked", "--format-version", "1"))
    packages = {(package["name"], package["version"]): package for package in meta["packages"]}
    # `cargo metadata` also has what no feature asks for; `cargo tree` has not, nor what only tests need.
    tree = cargo(
        "tree", "--locked", "-p", PROGRAM, "--target", target, "-e", "normal,build", "--prefix", "depth",
        "--format", " {p}", "--no-dedupe",
    )
    uses: dict[tuple[str, str], set] = {}
    path: list[tuple[str, str]] = []
    unused = None
    for line in tree.splitlines():
        depth, name, version, *_ = line.split()
        if unused is not None and int(depth) > unused:
            continue
        one = (name, version.lstrip("v"))
        del path[int(depth):]
        unused = int(depth) if path and only_for_no_build(packages[path[-1]], name) else None
        if unused is not None:
            continue
        if path:
            uses[path[-1]].add(one)
        path.append(one)
        uses.setdefault(one, set())
    return packages, uses, next(one for one in uses if one[0] == PROGRAM)


def only_for_no_build(package: dict, name: str) -> bool:
    """Whether a package is needed to build another one that has nothing to build: `cargo tree` lists it, and Cargo does not
    compile it (derive_more-impl 2.1.1 names rustc_version, and comes without a build script)."""
    kinds = {one["kind"] for one in package["dependencies"] if one["name"] == name}
    scripts = any("custom-build" in one["kind"] for one in package["targets"])
    return kinds == {"build"} and not scripts


def checksums() -> dict[tuple[str, str], str]:
    lock = tomllib.loads((ROOT / "Cargo.lock").read_text())
    return {(p["name"], p["version"]): p["checksum"] for p in lock["package"] if "checksum" in p}


def reference(package: dict) -> str:
    return f"pkg:cargo/{package['name']}@{package['version']}"


def component(package: dict, known: dict) -> dict:
    found = {
        "type": "library",
        "bom-ref": reference(package),
        "name": package["name"],
        "version": package["version"],
        "description": " ".join((package["description"] or "").split()),
        "purl": reference(package),
    }
    if package["license"]:
        # The older way to write "or".
        found["licenses"] = [{"expression": package["license"].replace("/", " OR ")}]
    checksum = known.get((package["name"], package["version"]))
    if checksum:
        found["hashes"] = [{"alg": "SHA-256", "content": checksum}]
    if package["repository"]:
        found["externalReferences"] = [{"type": "vcs", "url": package["repository"]}]
    return found


def standard_library() -> dict:
    """Linked into the program as well, and in no lock file."""
    printed = subprocess.run(["rustc", "-vV"], cwd=ROOT, check=True, capture_output=True, text=True).stdout
    release = next(line.split()[1] for line in printed.splitlines() if line.startswith("release: "))
    purl = f"pkg:generic/{STANDARD_LIBRARY}@{release}"
    return {
        "type": "library",
        "bom-ref": purl,
        "name": STANDARD_LIBRARY,
        "version": release,
        "description": "The standard library of Rust, with the crates that it uses",
        "purl": purl,
        "licenses": [{"expression": "MIT OR Apache-2.0"}],
        "externalReferences": [{"type": "vcs", "url": "https://github.com/rust-lang/rust"}],
    }


def sbom(target: str) -> dict:
    packages, uses, program = crates(target)
    known = checksums()
    order = sorted(uses)
    own = component(packages[program], known) | {"type": "application"}
    document = {
        "bomFormat": "CycloneDX",
        "specVersion": "1.5",
        "version": 1,
        "metadata": {
            "component": own,
            "properties": [{"name": "study:target", "value": target}],
        },
        "components": [component(packages[i], known) for i in order if i != program] + [standard_library()],
        "dependencies": [
            {"ref": reference(packages[i]), "dependsOn": sorted({reference(packages[d]) for d in uses[i]})}
            for i in order
        ],
    }
    epoch = os.environ.get("SOURCE_DATE_EPOCH")
    if epoch:
        import datetime

        time = datetime.datetime.fromtimestamp(int(epoch), datetime.timezone.utc)
        document["metadata"]["timestamp"] = time.strftime("%Y-%m-%dT%H:%M:%SZ")
    # A number of its own for each content.
    content = json.dumps(document, sort_keys=True)
    document["serialNumber"] = f"urn:uuid:{uuid.uuid5(uuid.NAMESPACE_URL, content)}"
    return document


def licenses(target: str) -> str:
    packages, uses, program = crates(target)
    texts: dict[str, list[str]] = {}
    without = []
    for i in sorted(uses):
        package = packages[i]
        if not package["source"]:
            continue
        name = f"{package['name']} {package['version']} ({package['license'] or 'see its text'})"
        folder = pathlib.Path(package["manifest_path"]).parent
        files = sorted(file for file in folder.iterdir() if file.is_file() and LICENSE_FILE.match(file.name))
        for file in files:
            text = "\n".join(line.rstrip() for line in file.read_text("utf-8", "replace").strip().splitlines())
            texts.setdefault(text, []).append(name)
        if not files:
            without.append(name)
    font = (ROOT / "crates/study-report/assets/LiberationSans-LICENSE.txt").read_text().strip()
    texts[font] = ["Liberation Sans, the font of PNG and PDF (OFL-1.1)"]
    parts = ["Licenses of what is in the program `study` beside its own code.\n"]
    if without:
        parts.append("These packages come without a file of their license:\n" + "\n".join(f"  {n}" for n in without) + "\n")
    for text, names in sorted(texts.items(), key=lambda item: item[1]):
        parts.append("=" * 100 + "\n" + "\n".join(dict.fromkeys(names)) + "\n" + "-" * 100 + "\n" + text + "\n")
    return "\n".join(parts)


def check(target: str, messages: str) -> None:
    """Every package that Cargo compiled is in the list, and no other."""
    built = set()
    for line in pathlib.Path(messages).read_text().splitlines():
        message = json.loads(line)
        if message["reason"] in ("compiler-artifact", "build-script-executed"):
            # Such as registry+https://…#name@1.0.0, or path+file:///…/name#1.0.0.
            place, _, rest = message["package_id"].rpartition("#")
            name, _, version = rest.rpartition("@")
            built.add((name or place.rsplit("/", 1)[-1], version))
    document = sbom(target)
    listed = [document["metadata"]["component"], *document["components"]]
    listed = [one for one in listed if one["name"] != STANDARD_LIBRARY]
    found = {(one["name"], one["version"]) for one in listed}
    for missing in sorted(built - found):
        print("built, and not in the list:", *missing)
    for more in sorted(found - built):
        print("in the list, and not built:", *more)
    bare = [one["name"] for one in listed if "licenses" not in one]
    if bare:
        print("without a license:", *bare)
    print(f"{len(found)} packages in the list for {target}, {len(built)} built")
    sys.exit(bool(built ^ found) or bool(bare))


def main() -> None:
    target, *options = sys.argv[1:]
    if options[:1] == ["--check"]:
        check(target, options[1])
    elif "--licenses" in options:
        sys.stdout.write(licenses(target))
    else:
        print(json.dumps(sbom(target), indent=1, ensure_ascii=False))


main()
