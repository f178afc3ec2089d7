# Pictures as by render, bad series recorded; up-to-date outputs are not rendered again; names and folders from outside.
py batch.py "$ctsplat" "$data" "$PWD" plain resume journal zip outputs odd_names
# Scouts and the like pass; journals name no files; unreadable files; the sheet of a running batch; rotations.
py batch.py "$ctsplat" "$data" "$PWD" passed single_slices paths lost sheet progress_lines circles
