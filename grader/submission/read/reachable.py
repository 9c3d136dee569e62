"""The part of a package that one of its executables needs, by what its files import or include."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from grader.recording.submission import PackageRecord, SourceFile
from grader.submission.read.cmake import read_commands
from grader.submission.read.includes import needed_files


def only_for(package: PackageRecord, executable: str) -> PackageRecord:
    """The package with the sources that an executable needs, and their imports.

    An executable that neither setup.py nor CMakeLists.txt defines, such as a script, has all.
    """
    commands, folder = read_commands(package.cmake or ""), package.file("")
    compiled = needed_files(executable, commands, folder, package.own_headers)
    if compiled is not None:
        return _compiled(package, *compiled)
    target = dict(package.entry_points).get(executable, "")
    files = {source.module: source for source in package.sources}
    pending = [target.partition(":")[0]]
    if not target or pending[0] not in files:
        return package
    needed: set[str] = set()
    while pending:
        module = pending.pop()
        if module not in needed:
            needed.add(module)
            pending += _imported(files[module], files)
    paths = {files[module].path for module in needed}
    return replace(
        package,
        imports=tuple(item for item in package.imports if item.file in paths),
        ros_imports=tuple(item for item in package.ros_imports if item.file in paths),
        sources=tuple(item for item in package.sources if item.path in paths),
    )


def _compiled(package: PackageRecord, files: set[str], lines: set[int]) -> PackageRecord:
    """The package with some files of C++, and some lines of its CMakeLists.txt."""
    cmake = package.file("CMakeLists.txt")
    included = (one for one in package.ros_imports if one.file in files)
    linked = (one for one in package.ros_imports if one.file == cmake and one.line in lines)
    sources = tuple(one for one in package.sources if one.path in files)
    return replace(package, ros_imports=(*included, *linked), sources=sources)


def _imported(source: SourceFile, files: Mapping[str, SourceFile]) -> list[str]:
    """Modules of the package that a module needs: imported ones, and the packages around them."""
    names = {*source.stars, *(dotted for _, dotted in source.names)}
    # `import bot.driver` is known as `bot`: any module of it may be meant.
    whole = {name for name in names if "." not in name}
    imported = {module for module in files if module.partition(".")[0] in whole}
    imported |= {module for module in files for name in names if _is_of(name, module)}
    packages = set()
    for module in (*imported, source.module):
        parts = module.split(".")
        packages |= {".".join(parts[:count]) for count in range(1, len(parts))}
    return sorted(imported | (packages & files.keys()))


def _is_of(name: str, module: str) -> bool:
    """Whether a dotted name is a module, or something in it."""
    return name == module or name.startswith(f"{module}.")
