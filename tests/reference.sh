#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# reference.sh SOURCES FOLDER: the API reference is made from the headers into FOLDER without a warning. Skips where
# Doxygen is missing. Prints TAP.
set -u
cd "$1" || exit 1
if ! command -v doxygen >/dev/null; then
    echo "1..0 # SKIP no doxygen"
    exit 0
fi
echo "1..1"
said=$({ cat docs/Doxyfile; echo "OUTPUT_DIRECTORY=$2"; } | doxygen - 2>&1 >/dev/null)
status=$?
if [ $status -eq 0 ] && [ -z "$said" ] && [ -s "$2/reference/vcache_8h.html" ]; then
    echo "ok 1 - the reference says something of each function, type, field and macro"
else
    echo "not ok 1 - the reference says something of each function, type, field and macro"
    printf '%s\n' "$said" | sed 's/^/# /'
    exit 1
fi
