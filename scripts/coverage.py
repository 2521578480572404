#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""coverage.py BUILD [LEAST]: lines of vcache/ and halton/ that the tests of a build with -Db_coverage=true ran, by gcov.
Fails where fewer than LEAST per cent of all were."""
import collections
import json
import os
import subprocess
import sys

build, least = sys.argv[1], float(sys.argv[2]) if len(sys.argv) > 2 else 0.0
counts = collections.defaultdict(dict)  # file: line: runs
for folder, _, files in os.walk(build):
    notes = [os.path.join(folder, f) for f in files if f.endswith(".gcda")]
    if not notes:
        continue
    out = subprocess.run(["gcov", "--json-format", "--stdout", *[os.path.abspath(n) for n in notes]], cwd=build,
                         capture_output=True, text=True, check=True).stdout
    for document in out.splitlines():
        for source in json.loads(document)["files"]:
            path = os.path.normpath(os.path.join(build, source["file"]))
            name = os.path.relpath(path, os.path.join(os.path.dirname(__file__), ".."))
            if name.startswith(("vcache/", "halton/")):
                for line in source["lines"]:
                    at = counts[name]
                    at[line["line_number"]] = max(at.get(line["line_number"], 0), line["count"])
total = run = 0
for name in sorted(counts):
    lines = counts[name]
    hit = sum(1 for n in lines.values() if n)
    total += len(lines)
    run += hit
    missed = [str(n) for n, c in sorted(lines.items()) if not c]
    print(f"{name:28} {hit:4} of {len(lines):4}" + (f"  not {', '.join(missed[:20])}" if missed else ""))
share = 100.0 * run / total if total else 0.0
print(f"coverage of vcache/ and halton/: {share:.1f} % of {total} lines")
sys.exit(share < least)
