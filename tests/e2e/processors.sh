# The same files on other processors: libraries and loops choose code by what the processor can do, which qemu and
# libjpeg-turbo's own switch change.
[ "$(uname -m)" = x86_64 ] || { echo "skip: not an x86-64 machine"; exit 77; }
[ "$CTS_SANITIZE" = none ] || { echo "skip: sanitizers are too slow under qemu"; exit 77; }
command -v qemu-x86_64 >/dev/null || { echo "skip: no qemu-x86_64"; exit 77; }
export SOURCE_DATE_EPOCH=0
# Without occlusion: qemu 7.2 computes other pictures with it by AVX2, where processors, which the unit tests restrict to
# AVX2, and valgrind agree with plain C.

# files FOLDER COMMAND...: every format, and the .dcm files' compressions, as COMMAND runs ctsplat
files()
{
    folder=$1
    shift
    mkdir "$folder"
    for words in "--compress jpeg-lossless -o $folder/a.png -o $folder/a.exr -o $folder/a.jpg -o $folder/a.webp -o $folder/a.dcm" \
        "--png-bits 8 --background none -o $folder/b.png -o $folder/b.webp --compress jpeg-lossless -o $folder/b.dcm" \
        "--mode mip -o $folder/c.png -o $folder/c.jpg -o $folder/c.webp --compress rle -o $folder/c.dcm"; do
        last="$* ctsplat render $words"
        # shellcheck disable=SC2086
        "$@" "$ctsplat" render "$data/phantom" --preset skin --occlusion 0 --view 30,20 --size 48x36 $words >out 2>err </dev/null ||
            fail "exit code $?, expected 0"
    done
}

# same FOLDER: its files are here's
same()
{
    for file in here/*; do
        cmp "$file" "$1/${file#*/}" || fail "$1: other bytes"
    done
}

files here env
[ "$(ls here | wc -l)" = 12 ] || fail "$(ls here | wc -l) files, expected 12"
files no-jpeg-simd env JSIMD_FORCENONE=1
same no-jpeg-simd
processors='Nehalem max'
[ -z "${CTS_SOAK-}" ] || processors='qemu64 Nehalem Haswell max'
for processor in $processors; do
    files "$processor" qemu-x86_64 -cpu "$processor"
    same "$processor"
done
