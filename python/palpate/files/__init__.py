"""Files: guarded reading of each format, atomic output of files and folders."""

from palpate.files.output import (
    as_path,
    atomic_write,
    check_suffix,
    check_writable,
    default_name,
    write_folder,
    write_json,
    write_text,
)
from palpate.files.reading import HDF5_SIGNATURE, begins_with, check_readable, read_bytes, read_utf8
from palpate.files.toml_text import find_line, load_toml

__all__ = [
    "HDF5_SIGNATURE",
    "as_path",
    "atomic_write",
    "begins_with",
    "check_readable",
    "check_suffix",
    "check_writable",
    "default_name",
    "find_line",
    "load_toml",
    "read_bytes",
    "read_utf8",
    "write_folder",
    "write_json",
    "write_text",
]
