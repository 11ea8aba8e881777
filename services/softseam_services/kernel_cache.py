"""Keeps numba's disk cache honest.

Numba keys a compiled kernel by the source of its own file alone, but the machine code holds the kernels that it calls
and the constants that it reads from other files, too: after an edit or an upgrade of one file, callers in unchanged
files would go on with the old code. So a kernel is dropped whenever its file or any that this one imports, directly or
not, or what compiles it, has changed. And services that start together would each compile the kernels that they share:
one compiles, the others wait for it.
"""

import ast
import contextlib
import fcntl
import gc
import hashlib
import importlib.util
import json
import os
from collections.abc import Iterable, Iterator, Mapping
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

_STAMP = "kernels.json"
COMPILED_BY = ("llvmlite", "numba", "numpy")
"""distributions on whose versions machine code depends"""


def kernel_packages() -> list[Path]:
    """Folders of the packages that hold kernels which may call each other."""
    names = ("softseam_services", "softseam_coupling")
    specs = (importlib.util.find_spec(name) for name in names)
    return [Path(spec.origin).parent for spec in specs if spec is not None and spec.origin is not None]


def drop_stale_kernels(packages: Iterable[Path]) -> int:
    """Forget compiled kernels whose sources, or `COMPILED_BY`, changed since the last call; how many were forgotten.

    On a file system that cannot be written nothing is done: nothing can change there either.
    """
    folders = list(packages)
    sources = {_module(folder, path): path for folder in folders for path in sorted(folder.rglob("*.py"))}
    texts = {module: path.read_bytes() for module, path in sources.items()}
    compiler = " ".join(_version(each) for each in COMPILED_BY).encode()
    everything = _digest(compiler, texts, sorted(texts))
    stamp = folders[0] / "__pycache__" / _STAMP
    dropped = 0
    with contextlib.suppress(OSError):
        known = _read(stamp)
        if known.get("") == everything:
            return 0
        imports = {m: _imports(texts[m], _package(m, path), texts) for m, path in sources.items()}
        now = {m: _digest(compiler, texts, _reached(m, imports)) for m, text in texts.items() if b"njit" in text}
        for module, path in sources.items():
            if module not in now or known.get(module) != now[module]:
                for index in (path.parent / "__pycache__").glob(f"{path.stem}.*.nbi"):
                    index.unlink(missing_ok=True)
                    dropped += 1
        stamp.parent.mkdir(exist_ok=True)
        fresh = stamp.with_suffix(f".{os.getpid()}")
        try:
            fresh.write_text(json.dumps(now | {"": everything}))
            fresh.replace(stamp)
        finally:
            fresh.unlink(missing_ok=True)  # what a full disk took of it
    return dropped


def _version(name: str) -> str:
    try:
        return version(name)
    except PackageNotFoundError:
        return ""  # nothing is compiled


def _module(folder: Path, path: Path) -> str:
    parts = path.relative_to(folder.parent).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def _digest(compiler: bytes, texts: Mapping[str, bytes], modules: Iterable[str]) -> str:
    digest = hashlib.sha256(compiler)
    for module in modules:
        digest.update(module.encode() + b"\0" + texts[module] + b"\0")
    return digest.hexdigest()


def _read(stamp: Path) -> dict[str, str]:
    """Digests by module, none where the stamp was never written or is damaged."""
    try:
        known = json.loads(stamp.read_text())
    except (OSError, ValueError):
        return {}
    return known if isinstance(known, dict) else {}


def _package(module: str, path: Path) -> list[str]:
    """Names of the package in which a module's relative imports begin."""
    parts = module.split(".")
    return parts if path.name == "__init__.py" else parts[:-1]


def _imports(text: bytes, package: list[str], modules: Mapping[str, bytes]) -> set[str]:
    """Those of `modules` that a source imports: `import a.b`, or `from a.b import c` where c may be a module itself."""
    found: set[str] = set()
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Import):
            found.update(name.name for name in node.names)
        elif isinstance(node, ast.ImportFrom):
            above = package[: len(package) - node.level + 1] if node.level else []
            source = ".".join([*above, node.module] if node.module else above)
            found.add(source)
            found.update(f"{source}.{name.name}" for name in node.names)
    return found & modules.keys()


def _reached(module: str, imports: Mapping[str, set[str]]) -> list[str]:
    """`module` and all that it imports, directly or not, in a fixed order."""
    seen = {module}
    waiting = [module]
    while waiting:
        for other in imports[waiting.pop()] - seen:
            seen.add(other)
            waiting.append(other)
    return sorted(seen)


@contextlib.contextmanager
def compiling(model: str) -> Iterator[None]:
    """One process of a machine at a time compiles the kernels of `model`; those that waited load them from the cache.

    The lock goes with its process, however that ends. Without a place for the lock there is none. The collector of
    garbage rests meanwhile: it would search what numba builds again and again, a tenth of the whole time.
    """
    lock = kernel_packages()[0] / "__pycache__" / f"{model}.lock"
    with contextlib.ExitStack() as held:
        with contextlib.suppress(OSError):
            fcntl.flock(held.enter_context(lock.open("w")), fcntl.LOCK_EX)
        if gc.isenabled():
            held.callback(gc.enable)
            gc.disable()
        yield
