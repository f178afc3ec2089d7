# Secondary captures as other makers' programs see them: each real series, each kind, each compression.
command -v dciodvfy >/dev/null && command -v dcentvfy >/dev/null || exit 77
shared=$root/../shared/data

# A validator's messages about a slice of the source, and those about the object that the slice does not cause.
old_words()
{
    dciodvfy "$1" 2>&1 | grep -E '^(Error|Warning)' | grep -oE '<[A-Za-z]+>|\(0x[0-9a-f]+,0x[0-9a-f]+\)|DICOMDIR - .*' |
        sort -u >source-words
}

new_words()
{
    dciodvfy "$1" 2>&1 | grep -E '^(Error|Warning)' | grep -vFf source-words
}

# The findings of dcentvfy, except attributes that are invalid in the source: missing, or empty, against their type.
check_entities()
{
    object=$1
    shift
    dcentvfy "$@" "$object" 2>&1 | grep -F "$object" | grep -vE '<(PatientBirthDate|PatientSex|DeidentificationMethod)>' >entities
    [ ! -s entities ] || fail "dcentvfy on $object: $(head -3 entities)"
}

series_of()
{
    echo phantom "$data/phantom"
    for name in head-phantom/S2020 head-tilt-ge chest-ge odd/two-series odd/coronal-anisotropic; do
        [ ! -d "$shared/$name" ] || echo "$(echo $name | tr / -)" "$shared/$name"
    done
}

series_of | while read -r name folder; do
    # A few slices have the headers of the whole series.
    case $name in phantom) most=48 ;; *) most=12 ;; esac
    find "$folder" -type f ! -name 'LIC*' ! -name DIRFILE | sort -V | head -$most >files
    rm -rf slices
    mkdir slices
    while read -r file; do ln -s "$file" "slices/$(echo "$file" | tr / -)"; done <files
    slice=$(head -1 files)
    old_words "$slice"
    uid=$("$ctsplat" info "$slice" --json | grep -oE '"series_uid": ?"[^"]*"' | head -1 | cut -d'"' -f4)
    case $name in odd-two-series) sed -n 1,4p files >few ;; *) cp files few ;; esac
    for kind in still turn mip-still mip-turn; do
        case $kind in *turn) more='--rotation 3' ;; *) more= ;; esac
        case $kind in mip*) more="$more --mode mip" ;; esac
        case $kind in still) more="$more --verify 64 --annotate orientation" ;; esac
        ok render slices ${uid:+--series "$uid"} --size 48x40 $more -o "$name-$kind.dcm" -o "$name-$kind.png"
        words=$(new_words "$name-$kind.dcm") && fail "dciodvfy on $name-$kind.dcm: $words"
        # shellcheck disable=SC2046
        check_entities "$name-$kind.dcm" $(grep -v ' ' few)
    done
    [ $name = phantom ] || rm "$name"-*
done || exit 1

# Compressed captures contain the same pixels for every reader.
old_words "$data/phantom/IM0001.dcm"
[ "$CTS_SANITIZE" = none ] && kinds='still turn mip-still mip-turn' || kinds='still mip-turn'
for compression in rle jpeg-lossless; do
    for kind in $kinds; do
        case $kind in *turn) more='--rotation 3' ;; *) more= ;; esac
        case $kind in mip*) more="$more --mode mip" ;; esac
        case $kind in still) more="$more --verify 64 --annotate orientation" ;; esac
        ok render "$data/phantom" --size 48x40 $more --compress $compression -o "phantom-$kind-$compression.dcm"
        words=$(new_words "phantom-$kind-$compression.dcm") &&
            fail "dciodvfy on phantom-$kind-$compression.dcm: $words"
        ok render "$data/phantom" --size 48x40 $more --compress $compression --threads 3 -o again.dcm --force
    done
done
py captures.py
exit 0
