#!/bin/bash
# AArch64 under emulation: aarch64.sh CTSPLAT FOLDER BUILD PACKAGE...
# Unpacks Debian's arm64 packages (those named, and what they depend on) into FOLDER, cross-compiles into BUILD, runs unit
# tests with qemu-aarch64, and compares the files of twelve scenes, byte for byte, with those of CTSPLAT, which runs on this
# machine. apt keeps all that it writes in FOLDER, so that the machine's own packages stay as they are.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../.."
ctsplat=$(realpath "$1") build=$3
mkdir -p "$2"
folder=$(realpath "$2")
shift 3
root=$folder/root

# unpack_packages PACKAGE...: into $root, whose /lib is /usr/lib
unpack_packages()
{
    local apt=$folder/apt deb link
    rm -rf "$root" "$apt"
    mkdir -p "$apt/lists/partial" "$apt/archives/partial" "$root/usr/lib"
    ln -s usr/lib "$root/lib"
    : >"$apt/status"
    printf '%s;\n' 'APT::Architecture "arm64"' 'APT::Architectures { "arm64" }' 'APT::Sandbox::User "root"' \
        "Dir::State \"$apt\"" "Dir::State::status \"$apt/status\"" "Dir::Cache \"$apt\"" >"$apt/apt.conf"
    APT_CONFIG=$apt/apt.conf apt-get update -q </dev/null
    APT_CONFIG=$apt/apt.conf apt-get install -q -y --no-install-recommends --download-only "$@" </dev/null
    for deb in "$apt"/archives/*.deb; do
        dpkg-deb --fsys-tarfile "$deb" | tar -x -C "$root" --keep-directory-symlink --exclude=./usr/share
    done
    # The linker follows symbolic links without regard to --sysroot.
    find "$root" -type l -lname '/*' | while read -r link; do
        ln -sfn "$root$(readlink "$link")" "$link"
    done
    rm -rf "$apt"
    touch "$root/complete"
}

[ -f "$root/complete" ] || unpack_packages "$@"

cat >"$folder/cross.ini" <<INI
[constants]
root = '$root'
[binaries]
c = 'aarch64-linux-gnu-gcc'
cpp = 'aarch64-linux-gnu-g++'
ar = 'aarch64-linux-gnu-gcc-ar'
strip = 'aarch64-linux-gnu-strip'
pkgconfig = 'pkg-config'
exe_wrapper = ['qemu-aarch64', '-L', root]
[built-in options]
c_args = ['--sysroot=' + root]
cpp_args = ['--sysroot=' + root]
c_link_args = ['--sysroot=' + root]
cpp_link_args = ['--sysroot=' + root]
[properties]
sys_root = root
pkg_config_libdir = root / 'usr/lib/aarch64-linux-gnu/pkgconfig'
[host_machine]
system = 'linux'
cpu_family = 'aarch64'
cpu = 'aarch64'
endian = 'little'
INI
[ -f "$build/build.ninja" ] || meson setup "$build" --cross-file "$folder/cross.ini" --werror -Dpython=disabled </dev/null
# qemu-user has no seccomp, which the first line's tests need to read compressed pixels, and threads of its own, which `parallel`
# counts. Those of the second line take minutes there; what they test is in the scenes, too.
left_out=(archive codecs frames limits sandbox sc parallel
    framing mixture mutation openness paper_equal renderer rows sheets table tiled tiled_light verify)
mapfile -t names < <(find tests/unit -name 'test_*.c' -printf '%f\n' | sed 's/^test_//; s/\.c$//' |
    grep -vxF "$(printf '%s\n' "${left_out[@]}")" | sort)
ninja -C "$build" programs "${names[@]/#/tests/unit/test_}" </dev/null

work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
export SOURCE_DATE_EPOCH=0
n=0 differing=0

# scene ENDING OPTION...
scene()
{
    local ending=$1
    shift
    n=$((n + 1))
    "$ctsplat" render testdata/phantom --force --view 30,20 --size 160x128 -o "$work/here.$ending" "$@" >/dev/null 2>"$work/here.txt" </dev/null ||
        { cat "$work/here.txt"; exit 1; }
    if ! qemu-aarch64 -L "$root" "$build/src/cli/ctsplat" render testdata/phantom --force --view 30,20 --size 160x128 \
        -o "$work/there.$ending" "$@" >/dev/null 2>"$work/there.txt" </dev/null; then
        cat "$work/there.txt"
    elif cmp "$work/here.$ending" "$work/there.$ending"; then
        return
    fi
    differing=$((differing + 1))
    echo "AArch64 differs: .$ending $*"
}

for engine in classic layers void combined sheets; do
    scene png -p bone --engine "$engine"
done
scene exr -p skin --engine tiled
scene exr -p muscle --engine raycast --size 80x64
scene webp -p skin --occlusion 0.5 --background none
scene jpg -p lung
scene dcm --mode mip --compress jpeg-lossless
scene png --mode minip
scene dcm --mode average --compress rle
tests=passed
meson test -C "$build" --no-rebuild --print-errorlogs --timeout-multiplier 20 --suite unit "${names[@]}" </dev/null || tests=failed
echo "AArch64: $n scenes, $differing differ from this machine's; ${#names[@]} unit tests $tests"
[ "$differing" = 0 ] && [ $tests = passed ]
