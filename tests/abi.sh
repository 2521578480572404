#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# abi.sh SOURCES FOLDER-OF-LIBVCACHE: what docs/abi.md promises of structs with their size. A later library of the same
# soname is made, whose structs have a field more with a default other than 0; hosts of one version run with the other's
# library. Prints TAP.
set -u
source=$1 own=$2 n=0 bad=0
dir=$(mktemp -d) || exit 1
trap 'rm -rf "$dir"' EXIT

report() { # STATUS WHAT
    n=$((n + 1))
    if [ "$1" -eq 0 ]; then echo "ok $n - $2"; else echo "not ok $n - $2"; sed 's/^/# /' "$dir/log"; bad=1; fi
}
if [ ! -e "$own/libvcache.so" ]; then
    echo "1..0 # SKIP no shared library"
    exit 0
fi

mkdir "$dir/later" && cp -r "$source/vcache" "$dir/later"
sed -i -E 's/^\} vcache_(config|worker_config|adaptive_config|grid_config|statistics|adaptive_statistics|grid_statistics);/    uint64_t later;\n&/' \
    "$dir"/later/vcache/{vcache,adaptive,grid}.h
# the default is 77, and a library of this kind knows no other value but 5
sed -i -E 's/\.size = sizeof(\([a-z_]+\)| f),/& .later = 77,/
           s/^(static vcache_status check\(const [a-z_]+ \*f, char \*message\))$/\1;\n\1/' "$dir"/later/vcache/*.c
sed -i -E '/^static vcache_status check\(.*[^;]$/,/^\{/ s/^\{/{\n    if (f->later != 77 \&\& f->later != 5)\n        return vcache_complain(message, VCACHE_ERROR_ARGUMENT, "later");/
           s/^( *)if \(chosen\.capacity < 1/\1if (chosen.later != 77 \&\& chosen.later != 5)\n        return vcache_complain(message, bad, "later");\n&/' \
    "$dir"/later/vcache/*.c
changed=$(cd "$dir/later" && cat vcache/*.[ch] | grep -cE '^    uint64_t later;|\.later = 77|"later"')
[ "$changed" -eq 15 ]
report $? "a later version: 7 structs, 4 defaults, 4 checks ($changed)"

build="${CC:-cc} -std=c11 -O1 -Wall -Wextra -Werror"
$build -fPIC -shared -ffp-contract=off -fvisibility=hidden -I"$dir/later" "$dir"/later/vcache/*.c -lm \
    -Wl,-soname,"$(basename "$(readlink "$own/libvcache.so")")" -o "$dir/later/libvcache.so" >"$dir/log" 2>&1 &&
    ln -s libvcache.so "$dir/later/$(basename "$(readlink "$own/libvcache.so")")"
report $? "the later library"
host="$source/tests/abi_host.c"
{ $build -I"$source" "$host" -L"$own" -lvcache -o "$dir/today" &&
    $build -I"$dir/later" "$host" -L"$dir/later" -lvcache -o "$dir/tomorrow" -DLATER=5 &&
    $build -I"$dir/later" "$host" -L"$dir/later" -lvcache -o "$dir/careful"; } >"$dir/log" 2>&1
report $? "hosts"

run() { LD_LIBRARY_PATH=$1 "$2" >"$dir/log" 2>&1; }
run "$own" "$dir/today"; report $? "today's host, today's library"
run "$dir/later" "$dir/today"; report $? "today's host, the later library: it takes defaults for what the host does not know"
run "$dir/later" "$dir/careful" && run "$dir/later" "$dir/tomorrow"; report $? "later hosts, the later library"
run "$own" "$dir/careful"; report $? "a later host that asks for nothing new, today's library"
run "$own" "$dir/tomorrow"
[ $? -eq 1 ] && grep -q "newer header" "$dir/log"; report $? "a later host that does is refused by today's library"
echo "1..$n"
exit $bad
