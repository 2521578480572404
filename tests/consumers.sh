#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# consumers.sh SOURCES BUILD VERSION: other people's projects, each from a fresh folder, in C and C++17, with gcc and
# clang: installed (pkg-config, shared and static; CMake), as a Meson subproject, by CMake's add_subdirectory, copied
# into a tree; the commands of the guide and of the examples as they stand there. Prints TAP.
set -u
root=$1 build=$2 version=$3 n=0 bad=0
dir=$(mktemp -d) || exit 1
trap 'rm -rf "$dir"' EXIT
unset DESTDIR CFLAGS CXXFLAGS LDFLAGS MESON_TESTTHREADS

report() { # STATUS WHAT: with the log where it failed
    n=$((n + 1))
    if [ "$1" -eq 0 ]; then
        echo "ok $n - $2"
    else
        echo "not ok $n - $2"
        sed 's/^/# /' "$dir/log" | tail -n 20
        bad=1
    fi
}
skip() { n=$((n + 1)); echo "ok $n - $1 # SKIP $2"; }

fresh() { # NAME: a folder with the consumers
    rm -rf "${dir:?}/$1"
    mkdir "$dir/$1" && cp "$root"/tests/consumers/* "$dir/$1" && cd "$dir/$1" || exit 1
}
sources() { # what of the project another project needs
    mkdir -p "$1" && cp -r "$root"/{vcache,halton,meson.build,meson_options.txt,CMakeLists.txt} "$1"
}
say_version() { # PROGRAM...: each runs and prints the version
    local p
    for p in "$@"; do
        [ "$("$p" 2>&1 | tee -a "$dir/log")" = "$version" ] || return 1
    done
}
have() { command -v "$1" >/dev/null; }

# ------------------------------------------------------------------------------------------------------- installed
log=$build/meson-logs/install-log.txt # of who installs from this folder
[ -e "$log" ] && cp "$log" "$dir/install-log.txt"
meson install -C "$build" --no-rebuild --quiet --destdir "$dir/installed" >"$dir/log" 2>&1
report $? "meson install"
[ -e "$dir/install-log.txt" ] && cp "$dir/install-log.txt" "$log" || rm -f "$log"
pc=$(dirname "$(find "$dir/installed" -name vcache.pc)")
libdir=$(dirname "$pc")
prefix=${libdir%/lib*}
missing=0
wanted=(include/vcache/{vcache,adaptive,grid,save}.h include/halton/halton.h share/doc/vcache/README.md
        share/doc/vcache/docs/cache.md share/doc/vcache/docs/pictures/atrium.jpg share/doc/vcache/examples/spheres.c)
[ -e "$build/man/whitted.1" ] && wanted+=(share/man/man1/whitted.1 share/man/man1/bdpt.1)
: >"$dir/log"
for file in "${wanted[@]}"; do
    [ -e "$prefix/$file" ] || { echo "missing: $file" >>"$dir/log"; missing=1; }
done
report $missing "headers, documents, man pages"
python3 "$root/tests/documents.py" "$prefix/share/doc/vcache" >"$dir/log" 2>&1
report $? "links of the installed documents"

shared=$libdir/libvcache.so static=$libdir/libvcache.a
if [ -e "$shared" ]; then
    readelf -d "$shared" >"$dir/log"
    grep -q "SONAME.*libvcache.so.${version%.*}]" "$dir/log"
    report $? "soname is libvcache.so.${version%.*}"
fi
export PKG_CONFIG_LIBDIR=$pc PKG_CONFIG_SYSROOT_DIR=$dir/installed LD_LIBRARY_PATH=$libdir
flags="-Wall -Wextra -Wpedantic -Werror"
for pair in "gcc g++" "clang clang++"; do
    read -r cc cxx <<<"$pair"
    if ! have $cc || ! have $cxx; then
        skip "consumers with $cc" "no $cc or $cxx"
        continue
    fi
    if have pkg-config && [ -e "$shared" ]; then
        fresh package
        { $cc -std=c11 $flags consumer.c -o c $(pkg-config --cflags --libs vcache halton) &&
            $cxx -std=c++17 $flags consumer.cpp -o cpp $(pkg-config --cflags --libs vcache halton) &&
            [ "$(pkg-config --modversion vcache)" = "$version" ] && say_version ./c ./cpp; } >"$dir/log" 2>&1
        report $? "pkg-config, shared, $cc"
        ldconfig -p 2>/dev/null | grep -q libvcache ||
            { env -u LD_LIBRARY_PATH ./c 2>&1 | grep "libvcache.so.${version%.*}: cannot open shared object file"; } >"$dir/log"
        report $? "the same where the loader does not look"
    fi
    if have pkg-config && [ -e "$static" ]; then
        fresh package
        libs=$(pkg-config --static --libs vcache halton)
        libs=${libs//-lvcache/-l:libvcache.a}
        libs=${libs//-lhalton/-l:libhalton.a}
        { $cc -std=c11 $flags consumer.c -o c $(pkg-config --cflags vcache) $libs &&
            $cxx -std=c++17 $flags consumer.cpp -o cpp $(pkg-config --cflags vcache) $libs &&
            ! readelf -d c cpp | grep NEEDED.*vcache && say_version ./c ./cpp; } >"$dir/log" 2>&1
        report $? "pkg-config, static, $cc"
    fi
    if have cmake; then
        fresh find
        { CC=$cc CXX=$cxx cmake -B out -DCMAKE_PREFIX_PATH="$prefix" -DCMAKE_FIND_USE_PACKAGE_REGISTRY=OFF &&
            cmake --build out && say_version out/consumer_c out/consumer_cpp; } >"$dir/log" 2>&1
        report $? "CMake, find_package, $cc"
        fresh folder
        sources vcache
        { CC=$cc CXX=$cxx cmake -B out -DFOLDER=ON -DCMAKE_BUILD_TYPE=Debug &&
            cmake --build out -j 2 && say_version out/consumer_c out/consumer_cpp; } >"$dir/log" 2>&1
        report $? "CMake, add_subdirectory, $cc"
    else
        skip "CMake, $cc" "no cmake"
    fi
    fresh subproject
    sources subprojects/vcache
    { CC=$cc CXX=$cxx meson setup out --buildtype=debug && ninja -C out &&
        [ ! -e out/subprojects/vcache/tests ] && [ ! -e out/subprojects/vcache/renderers ] &&
        say_version out/consumer_c out/consumer_cpp; } >"$dir/log" 2>&1
    report $? "Meson subproject, $cc"
    fresh copied
    cp -r "$root/vcache" "$root/halton" .
    { $cc -std=c11 -ffp-contract=off $flags -c vcache/*.c halton/halton.c &&
        $cc -std=c11 $flags -I. consumer.c *.o -lm -o c &&
        $cxx -std=c++17 $flags -I. consumer.cpp *.o -lm -o cpp && say_version ./c ./cpp; } >"$dir/log" 2>&1
    report $? "copied, $cc"
done
unset PKG_CONFIG_SYSROOT_DIR LD_LIBRARY_PATH
# the commands are on trial, not the code that comes of them: after -O3, and so in its place (-O0 makes the example slow)
export CFLAGS=-O1 CXXFLAGS=-O1

# ---------------------------------------------------------------------------------------------- as the documents say
fresh clone
tar -C "$root" --exclude='./build*' --exclude=./out --exclude=./.git -cf - . | tar xf -
commands() { sed -n "/^    $1/s/^    //p" "$2"; } # the indented lines of a document that begin like this
guide=$(commands 'meson setup' docs/guide.md; commands 'ninja -C build' docs/guide.md)
{ [ "$(wc -l <<<"$guide")" -eq 2 ] && PKG_CONFIG_LIBDIR=/nowhere bash -ec "$guide" && build/examples/before; } >"$dir/log" 2>&1
report $? "the guide's first commands, where nothing else is installed"
one=$(commands 'cc ' examples/README.md)
{ [ -n "$one" ] && bash -ec "$one" && [ "$(./spheres)" = "$(build/examples/spheres)" ]; } >"$dir/log" 2>&1
report $? "an example by itself: $one"

# ------------------------------------------------------------------------------------------------ static alone, away
{ meson configure build -Ddefault_library=static --prefix="$dir/static" --libdir=lib && ninja -C build &&
    meson install -C build --quiet; } >"$dir/log" 2>&1
report $? "a static library alone, installed"
export PKG_CONFIG_LIBDIR=$dir/static/lib/pkgconfig
fresh static-package
{ cc -std=c11 consumer.c -o c $(pkg-config --cflags --libs vcache halton) &&
    c++ -std=c++17 consumer.cpp -o cpp $(pkg-config --cflags --libs vcache halton) && say_version ./c ./cpp; } >"$dir/log" 2>&1
report $? "pkg-config, the static library alone"
if have cmake; then
    { cmake -B out -DCMAKE_PREFIX_PATH="$dir/static" -DCMAKE_FIND_USE_PACKAGE_REGISTRY=OFF && cmake --build out &&
        say_version out/consumer_c out/consumer_cpp; } >"$dir/log" 2>&1
    report $? "CMake, find_package, the static library alone"
    fresh folder
    sources vcache
    { cmake -B out -DFOLDER=ON -DBUILD_SHARED_LIBS=ON && cmake --build out -j 2 && ls out/vcache/libvcache.so."${version%.*}" &&
        say_version out/consumer_c out/consumer_cpp; } >"$dir/log" 2>&1
    report $? "CMake, add_subdirectory, shared"
fi
{ ninja -C "$dir/clone/build" uninstall && [ -z "$(find "$dir/static" ! -type d 2>/dev/null)" ]; } >"$dir/log" 2>&1
report $? "uninstalled again"
echo "1..$n"
exit $bad
