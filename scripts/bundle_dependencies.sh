#!/usr/bin/env bash
# Puts what apt installs for the build into one small archive, for machines that have torch, cmake and a compiler and nothing
# else: static libraries with no more in them than antipode uses, and headers. Takes half an hour on two cores; built from the
# distribution's own source packages, so that the versions are those of `make setup`. Without assimp: the program then reads packs of
# meshes (antipode train pack), no files of them.
#
# usage: scripts/bundle_dependencies.sh OUT.tar.xz
# There: scripts/build_with_bundle.sh OUT.tar.xz
set -euo pipefail

if [ $# -ne 1 ]; then
  sed -n '2,9s/^# \{0,1\}//p' "$0" >&2
  exit 2
fi
out=$(realpath -m "$1")
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
prefix=$work/bundle
system=/usr/lib/$(dpkg-architecture -qDEB_HOST_MULTIARCH)
mkdir -p "$prefix/lib" "$prefix/include" "$prefix/licences" "$work/sources"

# The distribution's package lists with sources in place of packages, for this run alone.
use_source_packages() {
  mkdir -p "$work/apt/parts" "$work/apt/lists"
  local list
  for list in /etc/apt/sources.list /etc/apt/sources.list.d/{debian,ubuntu}*; do
    [ ! -f "$list" ] || sed 's/^Types: deb$/Types: deb-src/; s/^deb /deb-src /' "$list" >"$work/apt/parts/${list##*/}"
  done
  [ ! -f "$work/apt/parts/sources.list" ] || mv "$work/apt/parts/sources.list" "$work/apt/"
  apt_options=(-qq -o "Dir::Etc::SourceList=$work/apt/sources.list" -o "Dir::Etc::SourceParts=$work/apt/parts"
    -o "Dir::State::Lists=$work/apt/lists" -o APT::Sandbox::User=root)
  apt-get "${apt_options[@]}" update
}

# Its upstream source; what the distribution adds, mostly the rules of packaging, may be missing.
fetch() {
  mkdir -p "$work/sources/$1"
  (cd "$work/sources" && { apt-get "${apt_options[@]}" source --download-only "$1" || true; })
  # Documents that the distribution leaves out for their licence, but the installation looks for.
  [ "$1" != embree ] || touch "$work/sources/embree/"{readme.pdf,third-party-programs{,-TBB,-OIDN,-OIIO}.txt}
  tar xf "$(find "$work/sources" -maxdepth 1 -name "$1_*.orig.tar.*" ! -name '*.asc')" -C "$work/sources/$1" --strip-components=1
  find "$work/sources/$1" -maxdepth 1 \( -iname 'licen[sc]e*' -o -iname 'copying*' \) -type f \
    -exec sh -c 'cp "$1" "$2-${1##*/}"' _ {} "$prefix/licences/$1" \;
}

# build PACKAGE [CMAKE_OPTION...]
build() {
  local package=$1
  shift
  echo "bundle: $package"
  fetch "$package"
  cmake -S "$work/sources/$package" -B "$work/build" -G Ninja -DCMAKE_BUILD_TYPE=Release -DCMAKE_INSTALL_PREFIX="$prefix" \
    -DCMAKE_PREFIX_PATH="$prefix" -DCMAKE_INSTALL_LIBDIR=lib -DCMAKE_POSITION_INDEPENDENT_CODE=ON -DBUILD_SHARED_LIBS=OFF \
    -DBUILD_TESTING=OFF "$@" >"$work/log" 2>&1 && cmake --build "$work/build" --target install >"$work/log" 2>&1 || {
    tail -n 30 "$work/log" >&2
    exit 1
  }
  rm -rf "$work/build" "${work:?}/sources/$package"
}

# What the development packages hold as static libraries.
copy_static_libraries() {
  local headers=(zlib.h zconf.h jpeglib.h jmorecfg.h jerror.h png.h pngconf.h pnglibconf.h libexif openssl)
  local name
  for name in z jpeg png16 exif crypto; do cp "$system/lib$name.a" "$prefix/lib/"; done
  ln -s libpng16.a "$prefix/lib/libpng.a"
  for name in "${headers[@]}"; do
    cp -r "/usr/include/$name" "$prefix/include/" 2>/dev/null || cp -r "/usr/include/${system##*/}/$name" "$prefix/include/"
  done
  [ ! -d "/usr/include/${system##*/}/openssl" ] || cp "/usr/include/${system##*/}/openssl/"* "$prefix/include/openssl/"
  [ ! -f "/usr/include/${system##*/}/jconfig.h" ] || cp "/usr/include/${system##*/}/jconfig.h" "$prefix/include/"
  for name in zlib1g-dev libjpeg-dev libpng-dev libexif-dev libssl-dev; do
    cp -L "/usr/share/doc/$name/copyright" "$prefix/licences/$name"
  done
}

# merge_libraries INTO OTHERS...
merge_libraries() {
  (
    cd "$prefix/lib"
    { echo create merged.a && printf 'addlib %s\n' "$@" && printf 'save\nend\n'; } | ar -M
    rm "$@"
    mv merged.a "$1"
  )
}

build_libraries() {
  build eigen3 -DEIGEN_BUILD_DOC=OFF
  build nlohmann-json3 -DJSON_BuildTests=OFF
  build cli11 -DCLI11_BUILD_TESTS=OFF -DCLI11_BUILD_DOCS=OFF -DCLI11_BUILD_EXAMPLES=OFF
  build fmtlib -DFMT_TEST=OFF -DFMT_DOC=OFF
  build spdlog -DSPDLOG_FMT_EXTERNAL=ON -DSPDLOG_BUILD_EXAMPLE=OFF
  local no_cryptography=(-DENABLE_COMMONCRYPTO=OFF -DENABLE_GNUTLS=OFF -DENABLE_MBEDTLS=OFF -DENABLE_OPENSSL=OFF)
  build libzip "${no_cryptography[@]}" -DENABLE_BZIP2=OFF -DENABLE_LZMA=OFF -DENABLE_ZSTD=OFF -DBUILD_TOOLS=OFF -DBUILD_REGRESS=OFF \
    -DBUILD_EXAMPLES=OFF -DBUILD_DOC=OFF
  # One instruction set, so that there is one copy of everything, and of all geometries triangles.
  local name only_triangles=()
  for name in QUAD CURVE SUBDIVISION USER INSTANCE GRID POINT; do only_triangles+=("-DEMBREE_GEOMETRY_$name=OFF"); done
  build embree -DEMBREE_STATIC_LIB=ON -DEMBREE_ISPC_SUPPORT=OFF -DEMBREE_TUTORIALS=OFF -DEMBREE_TASKING_SYSTEM=INTERNAL \
    -DEMBREE_MAX_ISA=SSE2 "${only_triangles[@]}"
  merge_libraries libembree3.a lib{lexers,math,simd,sys,tasking}.a
  build ceres-solver -DMINIGLOG=ON -DCUDA=OFF -DGFLAGS=OFF -DSUITESPARSE=OFF -DCXSPARSE=OFF -DLAPACK=OFF -DEIGENSPARSE=ON \
    -DSCHUR_SPECIALIZATIONS=OFF -DBUILD_EXAMPLES=OFF -DBUILD_BENCHMARKS=OFF
  local without=()
  for name in IPP ITT TBB OPENMP OPENCL LAPACK EIGEN QUIRC ADE PROTOBUF GDAL GDCM TIFF WEBP OPENJPEG JASPER OPENEXR GTK FFMPEG \
    GSTREAMER V4L 1394 VTK; do
    without+=("-DWITH_$name=OFF")
  done
  for name in TESTS PERF_TESTS EXAMPLES JAVA ITT opencv_apps opencv_python_bindings_generator; do without+=("-DBUILD_$name=OFF"); done
  build opencv -DBUILD_LIST=core,imgproc,imgcodecs,features2d,calib3d "${without[@]}" -DCPU_DISPATCH=AVX2 -DENABLE_PRECOMPILED_HEADERS=OFF \
    -DBUILD_ZLIB=OFF -DBUILD_JPEG=OFF -DBUILD_PNG=OFF -DZLIB_LIBRARY="$prefix/lib/libz.a" -DJPEG_LIBRARY="$prefix/lib/libjpeg.a" \
    -DPNG_LIBRARY="$prefix/lib/libpng.a" -DOPENCV_GENERATE_PKGCONFIG=OFF
}

# So that it can lie anywhere: package configurations name libraries by where the bundle was made.
make_relocatable() {
  local file
  grep -rlE "$prefix|$system" "$prefix" --include='*.cmake' | while read -r file; do
    sed -i "s#\($prefix\|$system\)#\${_IMPORT_PREFIX}#g; s#\${_IMPORT_PREFIX}/lib\(z\|jpeg\|png\|png16\)\.\(a\|so\)#\${_IMPORT_PREFIX}/lib/lib\1.a#g" "$file"
  done
}

use_source_packages
copy_static_libraries
build_libraries
make_relocatable
rm -rf "$prefix"/{bin,share/{doc,man},lib/pkgconfig}
tar cJf "$out" -C "$work" bundle
echo "Bundle: $out, $(du -h "$out" | cut -f1)"
echo "Next, on the other machine: scripts/build_with_bundle.sh $(basename "$out")"
