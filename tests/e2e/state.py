"""Presentation states against the tables of PS3.3 A.80.2.3: required attributes, permitted values, and meaning."""
import math
import sys

try:
    import pydicom
except ImportError:
    sys.exit(0)

# Type 1: present with a value; 2: present. Sequences: their items' tables.
reference = {'ReferencedSOPClassUID': 1, 'ReferencedSOPInstanceUID': 1}
code = {'CodeValue': 1, 'CodingSchemeDesignator': 1, 'CodeMeaning': 1}
tables = {
    'Patient (C.7.1.1)': {'PatientName': 2, 'PatientID': 2, 'PatientBirthDate': 2, 'PatientSex': 2},
    'General Study (C.7.2.1)': {'StudyInstanceUID': 1, 'StudyDate': 2, 'StudyTime': 2, 'ReferringPhysicianName': 2,
                                'StudyID': 2, 'AccessionNumber': 2},
    'General Series (C.7.3.1)': {'Modality': ('PR',), 'SeriesInstanceUID': 1, 'SeriesNumber': 2},
    'Frame of Reference (C.7.4.1)': {'FrameOfReferenceUID': 1, 'PositionReferenceIndicator': 2},
    'Enhanced General Equipment (C.7.5.2)': {'Manufacturer': 1, 'ManufacturerModelName': 1, 'DeviceSerialNumber': 1,
                                             'SoftwareVersions': 1},
    'Volumetric Presentation State Identification (C.11.22)': {
        'PresentationCreationDate': 1, 'PresentationCreationTime': 1, 'InstanceNumber': 1, 'ContentLabel': 1,
        'ContentDescription': 2, 'ContentCreatorName': 2, 'RenderedImageReferenceSequence': reference},
    'Volumetric Presentation State Relationship (C.11.23)': {
        'VolumetricPresentationInputSetSequence': {
            'VolumetricPresentationInputSetUID': 1, 'PresentationInputType': ('VOLUME',),
            'ReferencedImageSequence': reference},
        'VolumetricPresentationStateInputSequence': {
            'VolumetricPresentationInputNumber': 1, 'VolumetricPresentationInputSetUID': 1, 'Crop': ('YES', 'NO'),
            'WindowCenter': 1, 'WindowWidth': 1, 'VOILUTFunction': ('LINEAR', 'LINEAR_EXACT', 'SIGMOID')},
        'GlobalCrop': ('YES', 'NO')},
    'Presentation View Description (C.11.25)': {'ViewCodeSequence': code},
    'Volume Render Geometry (C.11.30)': {
        'RenderProjection': ('ORTHOGRAPHIC', 'PERSPECTIVE'), 'ViewpointPosition': 1, 'ViewpointLookAtPoint': 1,
        'ViewpointUpDirection': 1, 'RenderFieldOfView': 1,
        'RenderingMethod': ('MAXIMUM_IP', 'MINIMUM_IP', 'VOLUME_RENDERED')},
    'Render Display (C.11.32)': {
        'PixelPresentation': ('TRUE_COLOR',), 'ICCProfile': 1,
        'VolumeStreamSequence': {
            'VolumetricPresentationInputSetUID': 1,
            'PresentationStateClassificationComponentSequence': {
                'ComponentType': ('ONE_TO_RGBA', 'TWO_TO_RGBA'),
                'ComponentInputSequence': {'VolumetricPresentationInputIndex': 1},
                'RGBLUTTransferFunction': ('EQUAL_RGB', 'TABLE'),
                'AlphaLUTTransferFunction': ('NONE', 'IDENTITY', 'TABLE'),
                'RedPaletteColorLookupTableDescriptor': 1, 'RedPaletteColorLookupTableData': 1,
                'GreenPaletteColorLookupTableDescriptor': 1, 'GreenPaletteColorLookupTableData': 1,
                'BluePaletteColorLookupTableDescriptor': 1, 'BluePaletteColorLookupTableData': 1}}},
    'Common Instance Reference (C.12.2)': {
        'ReferencedSeriesSequence': {'SeriesInstanceUID': 1, 'ReferencedInstanceSequence': reference}},
    'SOP Common (C.12.1)': {'SOPClassUID': ('1.2.840.10008.5.1.4.1.1.11.9',), 'SOPInstanceUID': 1},
}
cropping = {'GlobalCroppingSpecificationIndex': 1, 'VolumeCroppingSequence': {
    'CroppingSpecificationNumber': 1, 'BoundingBoxCrop': 1,
    'VolumeCroppingMethod': ('BOUNDING_BOX', 'OBLIQUE_PLANES', 'INCLUDE_SEG', 'EXCLUDE_SEG')}}
shading = {'ShadingStyle': ('SINGLESIDED', 'DOUBLESIDED'), 'AmbientReflectionIntensity': 1, 'LightDirection': 1,
           'DiffuseReflectionIntensity': 1, 'SpecularReflectionIntensity': 1, 'Shininess': 1}


def check(item, table, where):
    for name, rule in table.items():
        here = '%s: %s' % (where, name)
        assert name in item, here + ' is missing'
        value = item[name].value
        if rule == 2:
            continue
        assert value not in (None, '', b'') and (not isinstance(rule, dict) or len(value) > 0), here + ' is empty'
        if isinstance(rule, dict):
            for one in value:
                check(one, rule, here)
        elif isinstance(rule, tuple):
            assert value in rule, '%s is %s' % (here, value)


def length(v):
    return math.sqrt(sum(x * x for x in v))


source = pydicom.dcmread(sys.argv[1] if len(sys.argv) > 1 else 'picture-1.dcm')
for n in range(1, 8):
    d = pydicom.dcmread('state-%d.dcm' % n)
    for module, table in tables.items():
        check(d, table, 'state-%d: %s' % (n, module))
    if d.GlobalCrop == 'YES':
        check(d, cropping, 'Volume Cropping (C.11.24)')
    if 'ShadingStyle' in d:
        check(d, shading, 'Render Shading (C.11.31)')
        assert all(0 <= d[name].value <= 1 for name in ('AmbientReflectionIntensity', 'DiffuseReflectionIntensity',
                                                        'SpecularReflectionIntensity', 'Shininess'))
    # One input, named everywhere by the same UID; every slice of one series; the picture by its own.
    uid = d.VolumetricPresentationInputSetSequence[0].VolumetricPresentationInputSetUID
    assert d.VolumetricPresentationStateInputSequence[0].VolumetricPresentationInputSetUID == uid
    assert d.VolumeStreamSequence[0].VolumetricPresentationInputSetUID == uid
    slices = d.VolumetricPresentationInputSetSequence[0].ReferencedImageSequence
    assert len(slices) == len(d.ReferencedSeriesSequence[0].ReferencedInstanceSequence) > 10
    picture = pydicom.dcmread('picture-%d.dcm' % n)
    assert d.RenderedImageReferenceSequence[0].ReferencedSOPInstanceUID == picture.SOPInstanceUID
    assert d.StudyInstanceUID == picture.StudyInstanceUID and d.PatientID == picture.PatientID
    # The camera: a unit up vector across the line of sight, the light along it, square pixels of the picture's scale.
    sight = [b - a for a, b in zip(d.ViewpointPosition, d.ViewpointLookAtPoint)]
    up = d.ViewpointUpDirection
    assert abs(length(up) - 1) < 1e-12 and abs(sum(a * b for a, b in zip(sight, up))) < 1e-9 * length(sight)
    if 'LightDirection' in d:
        assert max(abs(a / length(sight) - b) for a, b in zip(sight, d.LightDirection)) < 1e-12
    left, right, top, bottom, near, far = d.RenderFieldOfView
    assert right > left and top > bottom and far > near
    spacing = float(picture.PixelSpacing[0])
    assert abs((right - left) / picture.Columns - spacing) < 1e-9 * spacing
    assert abs((top - bottom) / picture.Rows - spacing) < 1e-9 * spacing
    # Tables have the number of entries in their descriptor.
    component = d.VolumeStreamSequence[0].PresentationStateClassificationComponentSequence[0]
    for colour in ('Red', 'Green', 'Blue', 'Alpha'):
        entries, first, bits = component[colour + 'PaletteColorLookupTableDescriptor'].value
        assert (first, bits) == (0, 16) and len(component[colour + 'PaletteColorLookupTableData'].value) == 2 * entries
    assert d[0x0073, 0x0010].value == 'CTSPLAT STATE 1'

# A known view: 30 degrees to the patient's right, 20 degrees up.
d = pydicom.dcmread('state-1.dcm')
sight = [b - a for a, b in zip(d.ViewpointPosition, d.ViewpointLookAtPoint)]
a, e = math.radians(-30), math.radians(20)
truth = (-math.sin(a) * math.cos(e), math.cos(a) * math.cos(e), -math.sin(e))
assert max(abs(x / length(sight) - y) for x, y in zip(sight, truth)) < 1e-12, (sight, truth)
assert pydicom.dcmread('state-3.dcm').RenderingMethod == 'MAXIMUM_IP'
assert list(pydicom.dcmread('state-5.dcm').VolumeCroppingSequence[0].BoundingBoxCrop) == [-60, -200, -200, 60.5, 200, 200]
