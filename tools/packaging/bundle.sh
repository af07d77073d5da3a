#!/usr/bin/env bash
# Makes one folder that runs anywhere, curvisplat-VERSION-linux-x86_64, of a build: the program with its libraries, which it finds
# from its own place; font, manual and examples. And an archive of it, and with --wheel a wheel for pip of the same parts.
#
#   tools/packaging/bundle.sh [--wheel] [--fast] [--example FILE ...] BUILD_FOLDER OUT_FOLDER
#
#   --wheel     also OUT_FOLDER/curvisplat-VERSION-*.whl, of a build with the Python package
#   --fast      for tests: without the archive, which takes a minute, and with a larger wheel
#   --example   a grid file to carry among the examples
#
# Needs Debian's patchelf, zstd, binutils and a C compiler. What is carried runs with the C library of the build machine or a later one.
set -euo pipefail

root=$(cd "$(dirname "${BASH_SOURCE[0]}")/../.." && pwd)
wheel= fast= examples=()
while [[ ${1:-} == --* ]]; do
  case $1 in
    --wheel) wheel=yes ;;
    --fast) fast=yes ;;
    --example)
      [[ -f ${2:-} ]] || { echo "bundle: --example needs a file that exists (found '${2:-}')" >&2 && exit 2; }
      examples+=("$2") && shift ;;
    *) echo "bundle: unknown option $1" >&2 && exit 2 ;;
  esac
  shift
done
[[ $# -eq 2 ]] || { echo "usage: bundle.sh [--wheel] [--fast] [--example FILE ...] BUILD_FOLDER OUT_FOLDER" >&2 && exit 2; }
for tool in patchelf zstd strip nm cc; do
  command -v $tool > /dev/null || { echo "bundle: $tool not found; apt-get install patchelf zstd binutils gcc" >&2 && exit 1; }
done
[[ -f $1/CMakeCache.txt ]] || { echo "bundle: $1 is not a build folder; build first: tools/build.sh curvisplat" >&2 && exit 2; }
build=$(realpath "$1")
mkdir -p "$2"
out=$(realpath "$2")
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
installed() { sed -n "s/^$1:[A-Z]*=//p" "$build/CMakeCache.txt"; }
version=$(installed CMAKE_PROJECT_VERSION)
bundle=$out/curvisplat-$version-linux-x86_64

# Of the C library, which every system has, and must have one only.
is_system() { [[ $1 =~ ^(ld-linux-x86-64|libc|libm|libdl|libpthread|librt|libresolv|libmpi)\.so ]]; }
# Which drivers of the system, loaded into the same process, need as well, perhaps in a later version: the system's are used where it has
# them. A system with this C library has none that are older.
is_fallback() { [[ $1 =~ ^lib(stdc\+\+|gcc_s|X11|Xau|Xdmcp|Xext|Xrender|xcb|xcb-render|xcb-shm|bsd|md)\.so ]]; }
# What libraries need for files over the network, TIFF files and rare encodings, which this program never asks them for. With them come
# 40 MB: OpenSSL, GnuTLS, Kerberos, LDAP, ICU. An empty library takes their place.
is_absent() { [[ $1 =~ ^lib(curl|curl-gnutls|tiff|icuuc)\.so ]]; }
# All others have names of their own, so that other versions in the same process (Python's modules) are never taken for them. Names keep
# their length: patchelf would write libopenvdb's 20 MB of names anew.
name_of() { is_fallback "$1" && echo "$1" || echo "${1/#lib/crv}"; }

# ------------------------------------------------------------------------------------------------ what is installed
for component in program mpi ${wheel:+python}; do
  DESTDIR=$work/installed cmake --install "$build" --strip --prefix "/$component" --component "$component" > /dev/null
done
program=$work/installed/program modules=$program/$(installed CMAKE_INSTALL_LIBDIR)/curvisplat
if [[ -d $work/installed/mpi ]]; then
  find "$work/installed/mpi" -name curvisplat-mpi.so -exec mv {} "$modules" \;
fi
objects=("$program/bin/curvisplat" "$modules"/*.so)
if [[ $wheel ]]; then
  package=$(find "$work/installed/python" -name curvisplat -path '*-packages/*')
  rm "$package"/curvisplat-{vdb,formats}.so  # the same as the program's
  objects+=("$package"/_core.*.so)
fi

# ------------------------------------------------------------------------------------------------ its libraries
declare -A path  # of a library, by the name that others ask for it
while read -r name _ file _; do
  [[ $file != /* ]] || path[$name]=$file
done < <(for object in "${objects[@]}"; do ldd "$object"; done)

declare -A taken
queue=("${objects[@]}")
lib=$work/lib
mkdir -p "$lib/fallback" "$work/stub"
while [[ ${#queue[@]} -gt 0 ]]; do
  object=${queue[0]} queue=("${queue[@]:1}")
  for name in $(patchelf --print-needed "$object"); do
    if is_system "$name"; then continue; fi
    if is_absent "$name"; then
      # The functions that are asked for: of those that it has, those undefined here.
      nm -D --with-symbol-versions --defined-only "${path[$name]}" | awk '{ print $NF }' | sort > "$work/defined"
      nm -D --undefined-only "$object" | awk '{ sub("@.*", "", $NF); print $NF }' | sort -u > "$work/undefined"
      awk -F@ 'NR == FNR { wanted[$1]; next } $1 in wanted { print $1, $NF == $1 ? "" : $NF }' \
        "$work/undefined" "$work/defined" >> "$work/stub/$name"
    fi
    [[ ! -v taken[$name] ]] || continue
    taken[$name]=yes
    is_absent "$name" || queue+=("${path[$name]:?bundle: $name not found}")
  done
done

for name in "${!taken[@]}"; do
  file=$lib/$(name_of "$name")
  if is_absent "$name"; then
    sort -u "$work/stub/$name" | awk -v map="$work/map" '
      { print "void* " $1 "(void) { return 0; }"; if ($2) of[$2] = of[$2] $1 ";" }
      END { for (v in of) print v " { " of[v] " };" > map; if (!length(of)) print "{ *; };" > map }' > "$work/stub.c"
    cc -shared -O2 -nostdlib -s -Wl,--version-script="$work/map" -Wl,-soname,"$(name_of "$name")" -fno-builtin -o "$file" "$work/stub.c"
  elif is_fallback "$name"; then
    cp "${path[$name]}" "$lib/fallback/$name"
  else
    cp "${path[$name]}" "$file"
  fi
done
chmod u+w "$lib"/*.so* "$lib"/fallback/*
renamed=()
for name in "${!taken[@]}"; do is_fallback "$name" || renamed+=("$name"); done
python3 - "${renamed[@]}" -- "$lib"/*.so* "${objects[@]}" <<'END'
import re, sys
end = sys.argv.index("--")
names = b"|".join(re.escape(name.removeprefix("lib")).encode() for name in sys.argv[1:end])
for file in sys.argv[end + 1:]:
    with open(file, "r+b") as stream:
        data = stream.read()
        stream.seek(0)
        stream.write(re.sub(rb"(?<=\0)lib(?=(?:" + names + rb")\0)", b"crv", data))
END

# What is carried, then the system's, then what stands in for them. DT_RPATH comes before LD_LIBRARY_PATH, and holds of libraries' libraries.
# search_in FOLDER FILE ...: FOLDER is that of the libraries, from where the files lie
search_in() {
  local system=/lib/x86_64-linux-gnu:/usr/lib/x86_64-linux-gnu:/lib64:/usr/lib64:/lib:/usr/lib
  patchelf --force-rpath --set-rpath "\$ORIGIN/$1:$system:\$ORIGIN/$1/fallback" "${@:2}"
}
for file in "$lib"/*.so*; do
  [[ -z $(patchelf --print-rpath "$file") ]] || patchelf --remove-rpath "$file"
done

# ------------------------------------------------------------------------------------------------ what is read beside it
font=$(installed CURVISPLAT_FONT)
[[ -f $font ]] || { echo "bundle: DejaVuSans.ttf not found; apt-get install fonts-dejavu-core, and configure again" >&2 && exit 1; }
licences=$work/licences
mkdir -p "$licences"
{
  for name in "${!taken[@]}"; do is_absent "$name" || realpath "${path[$name]}"; done
  realpath "$font"
} | sort -u | while read -r file; do
  # dpkg may know a file by its place before /lib became a link to /usr/lib.
  package_of=$(dpkg-query --search "$file" 2> /dev/null || dpkg-query --search "${file#/usr}" 2> /dev/null) ||
    { echo "bundle: $file is of no Debian package, so that its licence is not known" >&2 && exit 1; }
  package_of=${package_of%%:*}
  cp -L "/usr/share/doc/$package_of/copyright" "$licences/$package_of"
done

rm -rf "$bundle"
mkdir -p "$bundle"
cp -r "$program"/{bin,share,lib} "$bundle/"
cp -rl "$lib/." "$bundle/lib/" 2> /dev/null || cp -r "$lib/." "$bundle/lib/"  # links, where both folders are of one file system
doc=$bundle/share/doc/curvisplat
cp -r "$licences" "$doc/licences"
cp "$root"/{GLOSSARY.md,tools/REFERENCE.md,tools/FORMATS.md,tools/FROM_PARAVIEW.md,tools/cluster.md} "$doc/"
mkdir -p "$bundle"/share/curvisplat/examples
cp "$font" "$bundle/share/curvisplat/"
cp "$root"/tools/pictures/*.json "$root"/tools/python/examples/*.py "${examples[@]}" "$bundle/share/curvisplat/examples/"
cp "$root/tools/packaging/bundle.md" "$bundle/README.md"
search_in ../lib "$bundle/bin/curvisplat"
search_in "$(realpath --relative-to "${modules/#$program/$bundle}" "$bundle/lib")" "${modules/#$program/$bundle}"/*.so
du -sm "$bundle" | sed 's/\t/ MB: /'

if [[ ! $fast ]]; then
  tar --sort=name --owner=0 --group=0 --numeric-owner -C "$out" -c "$(basename "$bundle")" | zstd --quiet -19 -T0 --force -o "$bundle.tar.zst"
  du -m "$bundle.tar.zst" | sed 's/\t/ MB: /'
fi

# A wheel has all in one folder, the package's.
if [[ $wheel ]]; then
  mkdir "$work/wheel"
  mv "$package" "$work/wheel/"
  mv "$licences" "$work/wheel/licences"
  package=$work/wheel/curvisplat
  mv "$lib" "$package/lib"
  cp "$root/LICENSE" "$work/wheel/licences/curvisplat"
  cp "$program/bin/curvisplat" "$modules"/*.so "$font" "$package/"
  search_in lib "$package"/curvisplat "$package"/*.so
  "$root/tools/packaging/pack_wheel.py" "$work/wheel" "$version" "$out" ${fast:+1}
fi
