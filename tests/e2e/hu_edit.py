"""Writes a series with other HU: hu_edit.py FOLDER OUT EXPRESSION [ATTRIBUTE=EXPRESSION...]

EXPRESSION is numpy's, of hu (slices, rows, columns, as float64), i, j, k (the indices of columns, rows, slices) and rng
(seeded); its value, of any size in rows and columns, is stored as 16-bit numbers of slope 1. ATTRIBUTE is a keyword of
DICOM, its expression Python's, of d (the slice's data set) and k.
"""
import glob
import os
import sys

import numpy as np
import pydicom


def slices_of(folder):
    found = []
    for path in sorted(glob.glob(os.path.join(folder, '*'))):
        try:
            d = pydicom.dcmread(path)
        except (pydicom.errors.InvalidDicomError, IsADirectoryError):
            continue
        if 'PixelData' in d:
            found.append(d)
    return sorted(found, key=lambda d: float(np.dot(
        np.cross(d.ImageOrientationPatient[:3], d.ImageOrientationPatient[3:]), d.ImagePositionPatient)))


def main(folder, out, expression, *attributes):
    slices = slices_of(folder)
    hu = np.stack([d.pixel_array * float(d.RescaleSlope) + float(d.RescaleIntercept) for d in slices])
    k, j, i = np.indices(hu.shape)
    hu = eval(expression, {'np': np, 'hu': hu, 'i': i, 'j': j, 'k': k, 'rng': np.random.default_rng(1)})
    os.makedirs(out)
    for n, d in enumerate(slices):
        stored = np.clip(np.rint(hu[n]), -32768, 32767).astype('<i2')
        d.Rows, d.Columns = stored.shape
        d.RescaleSlope, d.RescaleIntercept, d.PixelRepresentation = 1, 0, 1
        d.BitsAllocated, d.BitsStored, d.HighBit = 16, 16, 15
        for keyword in 'PixelPaddingValue', 'SmallestImagePixelValue', 'LargestImagePixelValue':
            if keyword in d:
                delattr(d, keyword)
        for attribute in attributes:
            keyword, _, value = attribute.partition('=')
            setattr(d, keyword, eval(value, {'np': np, 'd': d, 'k': n}))
        d.file_meta.TransferSyntaxUID = pydicom.uid.ExplicitVRLittleEndian
        d.is_little_endian, d.is_implicit_VR = True, False
        d.PixelData = stored.tobytes()
        d['PixelData'].VR = 'OW'
        d.save_as(os.path.join(out, '%04d.dcm' % n))


main(*sys.argv[1:])
