# Killed, interrupted, beside one another, with series that crash or hang: the journal and the outputs stay whole.
py batch.py "$ctsplat" "$data" "$PWD" kill signals bad lock shards settled
