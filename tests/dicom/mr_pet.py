#!/usr/bin/env python3
"""MR and PET series that are written here: mr_pet.py CTSPLAT SOURCE_ROOT

SUV by an implementation of its own over 100 made headers; volumes at repeated positions; enhanced objects; mutated
headers. Exit 77 where numpy or pydicom is missing."""
import datetime
import math
import os
import subprocess
import sys
import tempfile

from labels_numpy import CTSPLAT, SHARED, Dataset, FileDataset, FileMetaDataset, Sequence, check, failures, generate_uid, info, np

MR, PET, ENHANCED_MR, ENHANCED_PET, LEGACY_PET = ('1.2.840.10008.5.1.4.1.1.' + n for n in ('4', '128', '4.1', '130', '128.1'))
AXIAL, CORONAL, SAGITTAL = [1, 0, 0, 0, 1, 0], [1, 0, 0, 0, 0, -1], [0, 1, 0, 0, 0, -1]
N, SIDE = 4, 8
random = np.random.default_rng(7)
STUDY = generate_uid()


def item(**values):
    d = Dataset()
    for name, value in values.items():
        setattr(d, name, value)
    return d


def write(folder, name, sop_class, words, **values):
    meta = FileMetaDataset()
    meta.TransferSyntaxUID = '1.2.840.10008.1.2.1'
    meta.MediaStorageSOPClassUID = sop_class
    d = FileDataset(None, {}, file_meta=meta, preamble=bytes(128))
    d.SOPClassUID, d.SOPInstanceUID = sop_class, generate_uid()
    d.StudyInstanceUID, d.FrameOfReferenceUID, d.PatientID = STUDY, STUDY + '.1', 'P'
    d.Modality = 'PT' if sop_class in (PET, ENHANCED_PET, LEGACY_PET) else 'MR'
    d.Rows, d.Columns = words.shape[-2:]
    d.SamplesPerPixel, d.PhotometricInterpretation = 1, 'MONOCHROME2'
    d.BitsAllocated, d.BitsStored, d.HighBit, d.PixelRepresentation = 16, 16, 15, 0
    d.PixelData = words.astype('<u2').tobytes()
    for key, value in values.items():
        if callable(value):
            value(d)
        elif value is not None:
            setattr(d, key, value)
    os.makedirs(folder, exist_ok=True)
    d.save_as(os.path.join(folder, name), write_like_original=False)


def slices(folder, sop_class, uid, n=N, base=0, spacing=2, orientation=AXIAL, tag='', each=lambda k: {}, **values):
    """One stack; a slice's stored values go from base + k to base + k + 63."""
    normal = np.cross(orientation[:3], orientation[3:])
    for k in range(n):
        words = base + k + np.arange(SIDE * SIDE).reshape(SIDE, SIDE)
        write(folder, f'{uid[-6:]}{tag}-{k}', sop_class, words,
              **{**dict(SeriesInstanceUID=uid, ImagePositionPatient=list(k * spacing * normal), PixelSpacing=[1, 1],
                        ImageOrientationPatient=orientation, InstanceNumber=k + 1, SliceThickness=spacing,
                        ImageType=['ORIGINAL', 'PRIMARY', 'M']), **values, **each(k)})


def listed(folder):
    code, err, found = info(folder)
    check(f'info {folder}', code == 0, err)
    series = {}
    for s in found['series'] if found else []:
        series.setdefault(s['series_uid'], []).append(s)
    return series


# --- SUV: QIBA's vendor-neutral formula ----------------------------------------------------------------------------

def clock(t):
    return t.strftime('%H%M%S.%f')


def expected_scale(h):
    """Quantity and factor by the same attributes, as numbers and datetimes."""
    if h['units'] == 'GML':
        return ('SUVbw', 1) if h['suv_type'] in (None, 'BW') else ('stored', 1)
    if h['units'] not in ('BQML', 'CNTS'):
        return 'stored', 1
    corrected, factor = {'ATTN', 'DECY'} <= set(h['corrected']), 1
    if h['units'] == 'CNTS':
        if h['philips_suv'] and corrected:
            return 'SUVbw', h['philips_suv']
        if not h['philips_bqml']:
            return 'stored', 1
        factor = h['philips_bqml']
    if not corrected or h['decay'] not in ('START', 'ADMIN') or not h['weight'] or not h['dose']:
        return 'Bq/ml', factor
    seconds = 0
    if h['decay'] == 'START':
        if not h['half_life'] or not h['start']:
            return 'Bq/ml', factor
        scan = h['series']
        if h['series'] > h['acquired']:
            rate = math.log(2) / h['half_life']
            width = h['duration'] * rate
            if h['ge_scan']:
                scan = h['ge_scan']
            elif h['reference'] and h['duration']:
                scan = h['acquired'] + datetime.timedelta(
                    seconds=-h['reference'] + math.log(width / (1 - math.exp(-width))) / rate)
            else:
                return 'Bq/ml', factor
        seconds = (scan - h['start']).total_seconds()
    return 'SUVbw', factor * h['weight'] * 1000 / (h['dose'] * 2 ** (-seconds / h['half_life'] if h['half_life'] else 0))


def pick(*values, p=None):
    return values[random.choice(len(values), p=p)]


def made_header():
    scan = datetime.datetime(2020, 2, 28, 23, 30) + datetime.timedelta(seconds=int(random.integers(0, 7200)))
    late = bool(random.random() < 0.4)
    return dict(
        units=pick('BQML', 'CNTS', 'GML', 'PROPCNTS', p=[.7, .15, .1, .05]), suv_type=pick(None, 'BW', 'LBM'),
        corrected=pick(['DECY', 'ATTN', 'SCAT'], ['NORM', 'ATTN', 'DECY'], ['DECY'], p=[.6, .3, .1]),
        decay=pick('START', 'ADMIN', 'NONE', p=[.75, .15, .1]), weight=pick(71.5, 3.25, 0, None, p=[.6, .3, .05, .05]),
        dose=pick(3.7e8, 2.22e7, None, p=[.6, .35, .05]), half_life=pick(6586.2, 1223.4, None, p=[.7, .25, .05]),
        start=pick(scan - datetime.timedelta(seconds=int(random.integers(60, 6000))), None, p=[.95, .05]),
        dated=pick('both', 'date', 'time'), series=scan + datetime.timedelta(days=late), acquired=scan, late=late,
        ge_scan=pick(scan - datetime.timedelta(seconds=31), None), reference=pick(150.25, 0),
        duration=pick(240.0, 1800.0), philips_suv=pick(0.00031, None), philips_bqml=pick(7.5, None), clock=None, drugs=1)


def write_header(folder, uid, h):
    drug = Dataset()
    if h['start'] and h['dated'] != 'time':
        drug.RadiopharmaceuticalStartDateTime = h['start'].strftime('%Y%m%d%H%M%S.%f')
    if h['start'] and h['dated'] != 'date':
        # Written to the minute beside the other one, which is used.
        drug.RadiopharmaceuticalStartTime = clock(h['clock'] or (h['start'].replace(second=0) if h['dated'] == 'both' else h['start']))
    drug.RadionuclideTotalDose, drug.RadionuclideHalfLife = h['dose'], h['half_life']

    def private(d):
        if h['ge_scan']:
            d.private_block(0x0009, 'GEMS_PETD_01', create=True).add_new(0x0D, 'DT', h['ge_scan'].strftime('%Y%m%d%H%M%S.00'))
        block = d.private_block(0x7053, 'Philips PET Private Group', create=True)
        for nn, value in ((0x00, h['philips_suv']), (0x09, h['philips_bqml'])):
            if value:
                block.add_new(nn, 'DS', str(value))
    slices(folder, PET, uid, Units=h['units'], SUVType=h['suv_type'], CorrectedImage=h['corrected'],
           DecayCorrection=h['decay'], PatientWeight=h['weight'], SeriesDate=h['series'].strftime('%Y%m%d'),
           SeriesTime=clock(h['series']), AcquisitionDate=h['acquired'].strftime('%Y%m%d'),
           RadiopharmaceuticalInformationSequence=Sequence([drug] * h['drugs']), ActualFrameDuration=int(h['duration'] * 1000),
           FrameReferenceTime=h['reference'] * 1000, private=private, SeriesType=['STATIC', 'IMAGE'], RescaleIntercept=0,
           each=lambda k: dict(RescaleSlope=round(10.5 + k / 7, 6), AcquisitionTime=clock(h['acquired'] + datetime.timedelta(seconds=k))))


def test_suv(work):
    folder, headers = os.path.join(work, 'suv'), {}
    for _ in range(100):
        uid = generate_uid()
        headers[uid] = made_header()
        write_header(folder, uid, headers[uid])
    found = listed(folder)
    for uid, h in headers.items():
        s = found[uid][0]
        quantity, factor = expected_scale(h)
        most = max((63 + k) * round(10.5 + k / 7, 6) for k in range(N)) * factor
        check('SUV', s['renderable'] and s['quantity'] == quantity and abs(s['value_max'] - most) <= 1e-6 * most,
              f"expected {quantity} up to {most}, is {s['quantity']} up to {s['value_max']}: {h} {s['findings']}")
        notes = [f['text'] for f in s['findings'] if f['code'] == 'no_suv']
        check('one warning', len(notes) == (quantity != 'SUVbw'), f'{h} {notes}')
    kinds = [expected_scale(h)[0] for h in headers.values()]
    check('all quantities', {'SUVbw', 'Bq/ml', 'stored'} <= set(kinds), str(kinds))


def test_refused_doses(work):
    """A dose in MBq, a weight in g, an injection after the scan, two readings of the header: Bq/ml and a reason."""
    good = dict(made_header(), units='BQML', corrected=['ATTN', 'DECY'], decay='START', weight=70, dose=3.7e8, half_life=6586,
                start=datetime.datetime(2020, 1, 1, 11), series=datetime.datetime(2020, 1, 1, 12), ge_scan=None,
                acquired=datetime.datetime(2020, 1, 1, 12), dated='both')
    noon = datetime.datetime(2020, 1, 1, 12)
    cases = {'dose': dict(dose=370), 'weight': dict(weight=70000), 'after': dict(start=noon + datetime.timedelta(minutes=5)),
             'days before': dict(start=noon - datetime.timedelta(days=3), dated='date'), 'minutes': dict(half_life=1.8),
             'two times': dict(clock=noon - datetime.timedelta(hours=2)), 'two drugs': dict(drugs=2)}
    for name, change in cases.items():
        uid, folder = generate_uid(), os.path.join(work, 'dose', name)
        write_header(folder, uid, {**good, **change})
        s = listed(folder)[uid][0]
        check(f'dose: {name}', s['quantity'] == 'Bq/ml' and 'no_suv' in str(s['findings']), str(s))


def test_pet_body():
    folder = os.path.join(SHARED, 'other', 'pet-body')
    if not os.path.isdir(folder):
        print('pet-body is missing')
        return
    import glob
    import pydicom
    most = 0
    for path in glob.glob(folder + '/**/*.dcm', recursive=True):
        d = pydicom.dcmread(path)
        most = max(most, float(d.RescaleSlope) * int(d.pixel_array.max()))
    drug = d.RadiopharmaceuticalInformationSequence[0]
    def seconds(tm):
        return int(tm[:2]) * 3600 + int(tm[2:4]) * 60 + float(tm[4:])
    wait = seconds(d.SeriesTime) - seconds(drug.RadiopharmaceuticalStartTime)
    factor = float(d.PatientWeight) * 1000 / (float(drug.RadionuclideTotalDose) * 2 ** (-wait / float(drug.RadionuclideHalfLife)))
    (s,), = listed(folder).values()
    check('pet-body', s['quantity'] == 'SUVbw' and s['slices'] == 267 and abs(s['value_max'] / (most * factor) - 1) < 1e-9,
          f"{s['value_max']} {most * factor}")
    note = [f['text'] for f in s['findings'] if f['code'] == 'fractional_rescale']
    check('largest rounding', len(note) == 1 and 'largest rounding is' in note[0], str(note))


# --- Volumes of one series -----------------------------------------------------------------------------------------

def several(folder, sop_class, parts, **common):
    uid = generate_uid()
    for p, values in enumerate(parts):
        slices(folder, sop_class, uid, base=500 * p, tag=f'-{p}', **{**common, **values})
    return uid


def test_volumes(work):
    folder, pet = os.path.join(work, 'volumes'), dict(Units='GML', RescaleSlope=1, RescaleIntercept=0)
    directions = [[1, 0, 0], [0, 1, 0], [0, 0, 1]]
    diffusion = [dict(DiffusionBValue=0.0)] + [dict(DiffusionBValue=1000.0, DiffusionGradientOrientation=d) for d in directions]

    def siemens(b):
        return lambda d: d.private_block(0x0019, 'SIEMENS MR HEADER', create=True).add_new(0x0C, 'IS', str(b))

    def beside(sop_class, offset_mm, **values):
        """Two stacks, the second one offset; values of both."""
        return several(folder, sop_class, [dict(each=lambda k, p=p: dict(
            ImagePositionPatient=[0, 0, 2 * k + p * offset_mm], **{name: both[p] for name, both in values.items()})) for p in range(2)])
    cases = {
        'echo numbers': (several(folder, MR, [dict(EchoNumbers=e) for e in (1, 2, 3)]), 3),
        'echo times': (several(folder, MR, [dict(EchoTime=e) for e in (4.6, 9.2)]), 2),
        'echoes of magnitude and phase': (several(folder, MR, [
            dict(EchoTime=e, ImageType=['ORIGINAL', 'PRIMARY', c]) for e in (5, 7) for c in 'MP']), 4),
        'in and out of phase': (several(folder, MR, [
            dict(EchoTime=e, ImageType=['DERIVED', 'PRIMARY', 'DIXON', w]) for e, w in ((1, 'IN'), (2, 'OUT'), (1, 'W'), (1, 'F'))]), 4),
        'inversion': (several(folder, MR, [dict(InversionTime=t) for t in (100, 400)]), 2),
        'flip angles': (several(folder, MR, [dict(FlipAngle=a) for a in (3, 15)]), 2),
        'diffusion': (several(folder, MR, diffusion), 4),
        'diffusion of Siemens': (several(folder, MR, [dict(private=siemens(b)) for b in (0, 800)]), 2),
        'time': (several(folder, MR, [dict(TemporalPositionIdentifier=t) for t in range(70)]), 70),
        'trigger': (several(folder, MR, [dict(each=lambda k, t=t: dict(TriggerTime=30 * t + k)) for t in range(5)]), 5),
        'component': (several(folder, MR, [dict(ComplexImageComponent=c) for c in ('REAL', 'IMAGINARY')]), 2),
        'nothing': (several(folder, MR, [{}, {}]), 0),
        'numbers, volume by volume': (several(folder, MR, [
            dict(each=lambda k, p=p: dict(InstanceNumber=p * N + k + 1)) for p in range(3)]), 3),
        'numbers, position by position': (several(folder, MR, [
            dict(each=lambda k, p=p: dict(InstanceNumber=3 * k + p + 1)) for p in range(3)]), 3),
        'numbers without order': (several(folder, MR, [
            dict(each=lambda k, p=p: dict(InstanceNumber=p * N + (k * 3 + p) % N + 1)) for p in range(3)]), 0),
        'numbers of dynamic PET': (several(folder, PET, [dict(SeriesType=['DYNAMIC', 'IMAGE'], each=lambda k, p=p: dict(
            InstanceNumber=p * N + k + 1)) for p in range(2)], **pet), 0),
        'orientations': (several(folder, MR, [dict(orientation=o) for o in (AXIAL, CORONAL, SAGITTAL)]), 3),
        'stacks of a spine': (several(folder, MR, [
            dict(orientation=[1, 0, 0, 0, math.cos(a), math.sin(a)]) for a in (0, 0.05, 0.1)]), 3),
        'attributes that vary within one volume': (several(folder, MR, [dict(each=lambda k: dict(
            EchoTime=k, TriggerTime=100 - k % 2, AcquisitionNumber=k % 2, ImageType=['ORIGINAL', 'PRIMARY', 'MP'[k // 2]]))]), 1),
        'echoes within the jitter': (beside(MR, 0.01, EchoTime=(5, 80)), 2),
        'echoes beside each other': (beside(MR, 0.3, EchoTime=(5, 80)), 2),
        'echoes in turn': (beside(MR, 1, EchoTime=(5, 80)), 2),
        'types in turn': (beside(MR, 1, ImageType=(['ORIGINAL', 'PRIMARY', 'M'], ['ORIGINAL', 'PRIMARY', 'P'])), 2),
        'times in turn': (beside(MR, 1, TemporalPositionIdentifier=(1, 2)), 2),
        'static in turn': (beside(PET, 1, SeriesType=[['STATIC', 'IMAGE']] * 2, FrameReferenceTime=(0, 600000), **{name: (value, value) for name, value in pet.items()}), 2),
        'echoes in no turn': (several(folder, MR, [dict(n=8, each=lambda k: dict(EchoTime=5 + 75 * (k in (1, 3, 4, 6))))]), 0),
        'dynamic': (several(folder, PET, [
            dict(SeriesType=['DYNAMIC', 'IMAGE'], FrameReferenceTime=t * 1e4) for t in range(3)], **pet), 3),
        'gated': (several(folder, PET, [dict(SeriesType=['GATED', 'IMAGE'], FrameReferenceTime=5, NumberOfSlices=N, each=lambda k, p=p: dict(
            ImageIndex=p * N + k + 1)) for p in range(3)], **pet), 3),
        'static': (several(folder, PET, [
            dict(SeriesType=['STATIC', 'IMAGE'], each=lambda k: dict(FrameReferenceTime=k))], **pet), 1),
        'static, repeated': (several(folder, PET, [
            dict(SeriesType=['STATIC', 'IMAGE'], FrameReferenceTime=t) for t in (1, 2)], **pet), 0),
        'reprojection': (several(folder, PET, [dict(SeriesType=['STATIC', 'REPROJECTION'])], **pet), 0),
        'mosaic': (several(folder, MR, [dict(ImageType=['ORIGINAL', 'PRIMARY', 'M', 'ND', 'MOSAIC'])]), 0),
        'turning projections': (several(folder, MR, [dict(each=lambda k: dict(
            ImageOrientationPatient=[math.cos(k), math.sin(k), 0, 0, 0, -1]))]), 0),
        'a scout of single cuts': (several(folder, MR, [dict(SliceThickness=5, spacing=30)]), 0),
        'thick slices with gaps': (several(folder, MR, [dict(SliceThickness=5, spacing=10)]), 1),
        'a rescale': (several(folder, MR, [dict(RescaleSlope=0.5, RescaleIntercept=-3, RescaleType='US')]), 1),
    }
    found = listed(folder)
    for name, (uid, n) in cases.items():
        volumes = [s for s in found[uid] if s['renderable']]
        check(f'volumes: {name}', len(volumes) == n and all(s['slices'] == N for s in volumes),
              f"expected {n}, found {len(volumes)}: {[s['findings'] for s in found[uid]][:2]}")
        lows = sorted(s['value_min'] for s in volumes)
        if name not in ('a rescale', 'nothing') and n:
            check(f'parts: {name}', lows == [500 * p for p in range(n)], str(lows))
    check('mosaic is named', 'mosaic of Siemens' in str(found[cases['mosaic'][0]]))
    check('a scout is passed', found[cases['a scout of single cuts'][0]][0]['passed'])
    check('reprojection is passed', found[cases['reprojection'][0]][0]['passed'])
    check('rescaled', found[cases['a rescale'][0]][0]['value_max'] == 0.5 * 66 - 3)


# --- Enhanced objects ----------------------------------------------------------------------------------------------

def enhanced(folder, sop_class, frames, shared=None, **values):
    """frames: functions of a slice's number that give functional groups; each is a volume."""
    uid, groups, words = generate_uid(), [], []
    for p, more in enumerate(frames):
        for k in range(N):
            groups.append(item(PlanePositionSequence=[item(ImagePositionPatient=[0, 0, 2 * k])],
                               PlaneOrientationSequence=[item(ImageOrientationPatient=AXIAL)],
                               PixelMeasuresSequence=[item(PixelSpacing=[1, 1], SliceThickness=2)], **more(k)))
            words.append(1000 * p + k + np.arange(SIDE * SIDE).reshape(SIDE, SIDE))
    write(folder, uid, sop_class, np.stack(words), SeriesInstanceUID=uid, NumberOfFrames=len(words),
          SharedFunctionalGroupsSequence=Sequence([shared or item()]), PerFrameFunctionalGroupsSequence=Sequence(groups), **values)
    return uid


def test_enhanced(work):
    folder = os.path.join(work, 'enhanced')
    one = [item(RescaleSlope=1, RescaleIntercept=0, RescaleType='US')]
    unit = item(RealWorldValueSlope=2.0, RealWorldValueIntercept=0.0,
                MeasurementUnitsCodeSequence=[item(CodeValue='Bq/ml', CodingSchemeDesignator='UCUM', CodeMeaning='Bq/ml')])
    drug = item(RadiopharmaceuticalStartDateTime='20200101230000', RadionuclideTotalDose=1e8, RadionuclideHalfLife=6600)
    reference = dict(DecayCorrected='YES', DecayCorrectionDateTime='20200102005000', AttenuationCorrected='YES',
                     PatientWeight=66, RadiopharmaceuticalInformationSequence=Sequence([drug]))

    def measured(**more):
        return lambda k: dict(PixelValueTransformationSequence=one, **more)
    cases = {
        'MR echoes': (enhanced(folder, ENHANCED_MR, [
            measured(MREchoSequence=[item(EffectiveEchoTime=e)]) for e in (5.0, 10.0)]), 2, 'stored', 1063 + 3),
        'MR diffusion': (enhanced(folder, ENHANCED_MR, [measured(MRDiffusionSequence=[item(
            DiffusionBValue=b, DiffusionGradientDirectionSequence=[item(DiffusionGradientOrientation=d)])])
            for b, d in ((500.0, [1.0, 0, 0]), (500.0, [0, 1.0, 0]), (900.0, [0, 1.0, 0]))]), 3, 'stored', 2066),
        'MR components': (enhanced(folder, ENHANCED_MR, [measured(MRImageFrameTypeSequence=[item(
            FrameType=['ORIGINAL', 'PRIMARY', 'ANGIO', 'NONE'], ComplexImageComponent=c)]) for c in ('MAGNITUDE', 'PHASE')]),
            2, 'stored', 1066),
        'MR frames in order': (enhanced(folder, ENHANCED_MR, [measured(FrameContentSequence=[item(
            TemporalPositionIndex=p % 2 + 1)]) for p in range(4)]), 4, 'stored', 3066),
        'MR without rescale': (enhanced(folder, ENHANCED_MR, [lambda k: {}]), 1, 'stored', 66),
        'PET': (enhanced(folder, ENHANCED_PET, [measured(RealWorldValueMappingSequence=[unit])], **reference), 1, 'SUVbw',
                132 * 66000 / 5e7),
        'PET of unknown unit': (enhanced(folder, ENHANCED_PET, [measured()], **reference), 1, 'stored', 66),
        'PET without decay correction': (enhanced(folder, ENHANCED_PET, [measured(RealWorldValueMappingSequence=[unit])]), 1,
                                         'Bq/ml', 132),
        'PET frames in time': (enhanced(folder, ENHANCED_PET, [measured(FrameContentSequence=[item(
            FrameReferenceDateTime=f'2020010110000{t}', TemporalPositionIndex=t + 1)]) for t in range(2)]), 2, 'stored', 1066),
        'legacy PET': (enhanced(folder, LEGACY_PET, [measured()], item(UnassignedSharedConvertedAttributesSequence=[item(
            Units='BQML', CorrectedImage=['ATTN', 'DECY'], DecayCorrection='ADMIN')]), PatientWeight=50,
            RadiopharmaceuticalInformationSequence=Sequence([drug])), 1, 'SUVbw', 66 * 50000 / 1e8),
    }
    found = listed(folder)
    for name, (uid, n, quantity, most) in cases.items():
        s = [s for s in found[uid] if s['renderable']]
        check(f'enhanced {name}', len(s) == n and all(v['quantity'] == quantity for v in s) and
              abs(max(v['value_max'] for v in s) - most) <= 1e-9 * most, f'expected {n}, {quantity}, {most}: {found[uid]}')


# --- Mutated headers -----------------------------------------------------------------------------------------------

def test_mutated(work):
    """Each series has one attribute changed, in all slices or in one: it is as before, it has a finding, or is refused."""
    folder, cases = os.path.join(work, 'mutated'), {}
    good = dict(made_header(), units='BQML', corrected=['ATTN', 'DECY'], decay='START', weight=70, dose=3.7e8, half_life=6586,
                start=datetime.datetime(2020, 1, 1, 11), series=datetime.datetime(2020, 1, 1, 12), ge_scan=None,
                acquired=datetime.datetime(2020, 1, 1, 12), dated='both')
    quantity, factor = expected_scale(good)
    names = {PET: ['Units', 'CorrectedImage', 'DecayCorrection', 'PatientWeight', 'SeriesTime', 'SeriesDate', 'AcquisitionTime',
                   'RescaleSlope', 'RescaleIntercept', 'SeriesType', 'FrameReferenceTime', 'ActualFrameDuration', 'SUVType'],
             MR: ['EchoTime', 'ImageType', 'FlipAngle', 'RescaleSlope', 'RescaleIntercept', 'TriggerTime', 'EchoNumbers']}
    both = ['Rows', 'BitsStored', 'HighBit', 'PixelRepresentation', 'PixelSpacing', 'ImagePositionPatient', 'Modality',
            'ImageOrientationPatient', 'SamplesPerPixel', 'PhotometricInterpretation', 'FrameOfReferenceUID', 'PatientID']
    import pydicom
    pydicom.config.settings.writing_validation_mode = 0
    for n in range(300):
        sop_class, uid = (PET, MR)[n % 2], generate_uid()
        name = pick(*names[sop_class], *both)
        how, where = pick('gone', 'empty', 'odd', 'number'), pick(None, 1)
        place = os.path.join(folder, str(n))
        if sop_class == PET:
            write_header(place, uid, good)
        else:
            slices(place, MR, uid, EchoTime=5, FlipAngle=10, EchoNumbers=1, TriggerTime=7, RescaleSlope=1, RescaleIntercept=0)
        for k, path in enumerate(sorted(os.listdir(place))):
            d = pydicom.dcmread(os.path.join(place, path))
            if where is not None and k != where:
                continue
            if how == 'gone' and name in d:
                del d[name]
            elif how == 'empty':
                setattr(d, name, None)
            elif how == 'odd' or name in ('Modality', 'PhotometricInterpretation', 'FrameOfReferenceUID', 'PatientID'):
                vr = pydicom.datadict.dictionary_VR(name)
                d[name] = pydicom.dataelem.RawDataElement(pydicom.tag.Tag(name), vr, 4, b'A1 b', 0, False, True)
            else:
                n = {'PixelSpacing': 2, 'ImagePositionPatient': 3, 'ImageOrientationPatient': 6}.get(name, 1)
                text = pydicom.datadict.dictionary_VR(name) not in ('US', 'DS', 'IS')
                setattr(d, name, '3' if text else 3 if n == 1 else [3] * n)
            d.save_as(os.path.join(place, path))
        cases[uid] = (sop_class, name, how, where)
    code, err, found = info(folder)
    check('mutated: info', code == 0, err)
    seen, n_right = str(found), 0
    for s in found['series']:
        if s['series_uid'] not in cases:
            continue
        sop_class, name, how, where = cases[s['series_uid']]
        most = 66 * round(10.5 + 3 / 7, 6) * factor if sop_class == PET else 66
        right = s['renderable'] and s['slices'] == N and abs(s['value_max'] - most) <= 1e-6 * most and \
            s['spacing_mm'] == [1, 1, 2]
        notes = [f for f in s['findings'] if f['code'] not in ('fractional_rescale', 'several_volumes')]
        n_right += right
        # A slope or intercept of 3 is as good as another.
        meant = how == 'number' and name in ('RescaleSlope', 'RescaleIntercept', 'PatientWeight', 'PixelSpacing')
        check('mutated', right or notes or not s['renderable'] or meant, f'silent: {cases[s["series_uid"]]} {s}')
    check('mutated: some are right', n_right > 50, str(n_right))
    check('mutated: all are there', all(uid in seen or uid for uid in cases))


def test_states(work):
    """A presentation state chooses its volume of a series, and of an enhanced object."""
    def render(folder, *options):
        run = subprocess.run([CTSPLAT, 'render', folder, '-o', f'{work}/state.png', '--force', *options], capture_output=True, text=True)
        check(f'render {options}', run.returncode == 0, run.stderr)
        with open(f'{work}/state.png', 'rb') as f:
            return f.read()
    classic, whole = os.path.join(work, 'state'), os.path.join(work, 'enhanced state')
    several(classic, MR, [dict(EchoTime=e) for e in (4.6, 9.2)])
    enhanced(whole, ENHANCED_MR, [lambda k, e=e: dict(MREchoSequence=[item(EffectiveEchoTime=e)]) for e in (5.0, 10.0)])
    for folder in classic, whole:
        own = [render(folder, '--series', n, '--mode', 'mip', '--window', '0,2000', '--size', '16x16', '--write-state',
                      f'{work}/{n}.dcm') for n in '12']
        check('two volumes', own[0] != own[1])
        check('of its state', own == [render(folder, '--state', f'{work}/{n}.dcm') for n in '12'], folder)


def main():
    with tempfile.TemporaryDirectory() as work:
        test_suv(work)
        test_refused_doses(work)
        test_pet_body()
        test_volumes(work)
        test_enhanced(work)
        test_mutated(work)
        test_states(work)
    print(f'{len(failures)} failures')
    sys.exit(len(failures) > 0)


main()
