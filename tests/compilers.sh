#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# compilers.sh SOURCES FOLDER-OF-THE-NATIVE-TESTS: keys are the same bits with gcc and clang, without optimisation and
# with all of it, and no file of the library compiles where arithmetic is not that of IEEE 754. Prints TAP.
set -u
source=$1 native=$2
dir=$(mktemp -d) || exit 1
trap 'rm -rf "$dir"' EXIT
number=0
result() { # STATUS NAME
    number=$((number + 1))
    if [ "$1" -eq 0 ]; then echo "ok $number - $2"; else echo "not ok $number - $2"; fi
}

compilers=
for c in gcc clang; do command -v $c >/dev/null && compilers="$compilers $c"; done

"$native/test_keys" 2>&1 | grep -ao 'checksum of .*0x[0-9a-f]*' >"$dir/native"
# the library's own flags; gnu11, where gcc contracts unless it is told not to
guards=$(sed -n "s/^vcache_args = .*(\(.*\))$/\1/p" "$source/vcache/meson.build" | tr -d "',")
flags="-std=gnu11 $guards -I$source -I$source/tests/small"
# where the machine multiplies and adds with one rounding, compilers may use it
fused=
grep -qsw fma /proc/cpuinfo && fused=-mfma
for c in $compilers; do
    for level in -O0 "-O3 $fused"; do
        [ "$c$level" = "gcc-O3 " ] && continue # the native one
        mkdir -p "$dir/$c$level"
        (cd "$dir/$c$level" && $c $flags $level "$source"/vcache/*.c "$source/tests/test_keys.c" -lm -o test) \
            >"$dir/log" 2>&1 && "$dir/$c$level/test" 2>&1 |
            grep -ao 'checksum of .*0x[0-9a-f]*' >"$dir/own"
        [ -s "$dir/own" ] && cmp -s "$dir/native" "$dir/own"
        result $? "$c $level: the same keys"
        [ -s "$dir/log" ] && sed 's/^/# /' "$dir/log"
        rm -f "$dir/own"
    done
done

# every part of -ffast-math that the compiler lets a program see
for c in $compilers; do
    for flag in -ffast-math -Ofast -ffinite-math-only -funsafe-math-optimizations; do
        [ "$($c $flag -dM -E - </dev/null 2>/dev/null | sort)" = "$($c -dM -E - </dev/null | sort)" ] && continue
        $c $flag -dM -E - </dev/null 2>/dev/null | grep -qE '__(FAST|ASSOCIATIVE)_MATH__|__FINITE_MATH_ONLY__ 1' || continue
        bad=0
        for file in "$source"/vcache/*.c; do
            if $c -std=c11 $flag -fsyntax-only -I"$source" "$file" 2>"$dir/log" || ! grep -q 'IEEE' "$dir/log"; then
                echo "# ${file##*/} compiles with $flag"
                bad=1
            fi
        done
        result $bad "$c $flag is refused"
    done
done
echo "1..$number"
