#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Builds the library and some of its tests for aarch64 and runs them under qemu: keys, kernels, predictions and picks must
# be the same bits there. Skips where the cross compiler or qemu is missing.
#   aarch64.sh SOURCES FOLDER-OF-THE-NATIVE-TESTS
set -u
source=$1 native=$2
compiler=aarch64-linux-gnu-gcc qemu=
for q in qemu-aarch64 qemu-aarch64-static; do
    [ -z "$qemu" ] && command -v $q >/dev/null && qemu=$q
done
if ! command -v $compiler >/dev/null || [ -z "$qemu" ]; then
    echo "1..0 # SKIP no $compiler or qemu-aarch64 (Debian: gcc-aarch64-linux-gnu libc6-dev-arm64-cross qemu-user)"
    exit 0
fi
dir=$(mktemp -d) || exit 1
trap 'rm -rf "$dir"' EXIT

tests="kernels picks estimate keys"
number=0
result() { # STATUS NAME [LOG]
    number=$((number + 1))
    if [ "$1" -eq 0 ]; then
        echo "ok $number - $2"
    else
        echo "not ok $number - $2"
        [ $# -gt 2 ] && sed 's/^/# /' "$3"
    fi
}

echo "1..9"
# the flags of vcache/meson.build
flags="-std=c11 -O3 -Wall -Wextra -Werror -ffp-contract=off -fno-math-errno -I$source"
(cd "$dir" && $compiler $flags -c "$source"/vcache/*.c) >"$dir/log" 2>&1
result $? "the library compiles" "$dir/log"

for t in $tests; do
    $compiler -std=c11 -O2 -ffp-contract=off -I"$source/tests/small" "$source/tests/test_$t.c" "$dir"/*.o -static -pthread -lm \
        -o "$dir/test_$t" >"$dir/log" 2>&1 && timeout 400 $qemu "$dir/test_$t" >"$dir/$t.txt" 2>&1
    status=$?
    [ -f "$dir/$t.txt" ] || cp "$dir/log" "$dir/$t.txt"
    result $status "test_$t passes" "$dir/$t.txt"
    # every checksum that the native test prints, whatever kernels it is of
    sums() { grep -ao 'checksum of .*0x[0-9a-f]*' "$1" | sed 's/scalar \|avx2 \|avx512 //' | sort -u; }
    "$native/test_$t" >"$dir/$t.native" 2>&1
    sums "$dir/$t.txt" >"$dir/a"
    sums "$dir/$t.native" >"$dir/b"
    cmp -s "$dir/a" "$dir/b" && { [ -s "$dir/a" ] || [ $t = estimate ]; }
    result $? "checksums of test_$t are those of this machine" "$dir/a"
done
