"""Builds and installs the package."""

from glob import glob

from setuptools import find_packages, setup

package_name = 'autonomy'

setup(
    name=package_name,
    version='0.1.0',
    packages=find_packages(exclude=['test']),
    data_files=[
        ('share/ament_index/resource_index/packages', ['resource/' + package_name]),
        ('share/' + package_name, ['package.xml']),
        ('share/' + package_name + '/launch', glob('launch/*')),
    ],
    install_requires=['setuptools'],
    zip_safe=True,
    maintainer='Student',
    maintainer_email='student@example.com',
    description='Perceives obstacles, and decides how to drive.',
    license='Apache-2.0',
    entry_points={
        'console_scripts': [
            'laser_frame = autonomy.laser_frame:main',
            'odom_frame = autonomy.odom_frame:main',
            'locator = autonomy.locator:main',
            'perception = autonomy.perception:main',
            'decision = autonomy.decision:main',
        ],
    },
)
