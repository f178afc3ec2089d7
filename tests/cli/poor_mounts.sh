# Outputs on file systems that lack calls, by a preloaded library: modes (CIFS), renaming without replacing and hard links
# (object stores), syncing, locks (Lustre, NFS, FUSE).
[ -r "${CTS_POOR_MOUNT:-}" ] || { echo "SKIP: no preloaded library"; exit 77; }
small="$data/syntax/explicit"
options='--size 32x32 --view 0,0'
export LD_PRELOAD="$CTS_POOR_MOUNT"

for lacks in fchmod 'renameat2 link' 'fchmod renameat2 link fsync'; do
    export CTS_LACKS="$lacks"
    mkdir pictures
    ok render "$small" $options -o pictures/a.png -o pictures/a.exr --log pictures/log.json
    refused 5 'exists' render "$small" $options -o pictures/a.png
    ok render "$small" $options -o pictures/a.png --force
    [ "$(ls -A pictures | tr '\n' ' ')" = 'a.exr a.png log.json ' ] || fail "$lacks: files are $(ls -A pictures)"
    ok batch "$small" -O batch $options --formats png --deidentify
    [ "$(stat -c %a .local/state/ctsplat/key)" = 600 ] || fail "$lacks: the key's mode is $(stat -c %a .local/state/ctsplat/key)"
    [ "$(ls -A .local/state/ctsplat)" = key ] || fail "$lacks: files beside the key"
    ! grep -q locks err || fail "$lacks: a warning about locks"
    rm -r pictures batch .local
done
export CTS_LACKS=renameat2,link
ok render "$small" $options -o same.png
CTS_LACKS= ok render "$small" $options -o expected.png
cmp same.png expected.png || fail "another picture"

for errno in 38 95 37; do # ENOSYS, EOPNOTSUPP, ENOLCK
    export CTS_LACKS=flock CTS_FLOCK_ERRNO=$errno
    ok batch "$small" -O "batch$errno" $options --formats png
    [ "$(grep -c 'warning: .*has no locks (flock: ' err)" = 1 ] || fail "errno $errno: not one warning about locks"
    for shard in 0 1; do
        ok batch "$small" -O "shards$errno" $options --formats png --shard $shard/2
    done
    [ "$(find "batch$errno" "shards$errno" -name '*.png' | wc -l)" = 2 ] || fail "errno $errno: not two pictures"
done
export CTS_FLOCK_ERRNO=11 # EWOULDBLOCK: another one has the lock
refused 1 'another batch is running there' batch "$small" -O batch38 $options --formats png
